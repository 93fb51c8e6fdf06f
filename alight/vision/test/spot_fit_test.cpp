#include "alight/vision/spot_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "alight/vision/test/scene.h"

namespace alight {
namespace {

using test::Picture;

constexpr double kSd = 1.0;
const PointSpread kSpread{kSd * kSd, 0.1};

struct Lights {
  std::vector<Vector2> uv;
  std::vector<double> height;
};

std::optional<SpotFit> fit(const Lights& lights, std::uint64_t seed, double start_sd,
                           int channels = 3, double sd = kSd) {
  Rng rng(seed);
  Picture picture(channels, 100, 80);
  for (std::size_t i = 0; i < lights.uv.size(); ++i) {
    picture.add(lights.uv[i], LedColor::green, lights.height[i], sd);
  }
  const ImageView image = picture.expose(rng);
  std::vector<LightSought> starts;
  for (const Vector2& uv : lights.uv) {
    starts.push_back({uv + start_sd * Vector2(rng.normal(), rng.normal())});
  }
  return fit_spots(image, starts, kSpread, Vector2::Zero(), {});
}

Lights draw(int count, double apart, Rng& rng) {
  Lights out;
  Vector2 at(50 + rng.uniform(), 40 + rng.uniform());
  for (int i = 0; i < count; ++i) {
    out.uv.push_back(at);
    out.height.push_back(rng.uniform(80, 220));
    at += apart * Vector2(std::cos(0.7 * i), std::sin(0.7 * i));
  }
  return out;
}

// Near the lens a bright light is full as far as a point's light reaches: every place
// within fits without a residual.
TEST(SpotFit, AFullLightIsPlacedRightOrNotAtAll) {
  const PointSpread narrow{0.63, 0.08};
  Rng rng(7);
  int placed = 0;
  constexpr int kRuns = 400;
  for (int run = 0; run < kRuns; ++run) {
    Picture picture(3, 100, 80);
    const Vector2 uv(50 + rng.uniform(), 40 + rng.uniform());
    const double light = rng.uniform(200, 4000), sd = rng.uniform(0.8, 1.3);
    picture.add(uv, LedColor::green, light, sd);
    const ImageView image = picture.expose(rng);
    LightSought sought{uv + 0.3 * Vector2(rng.normal(), rng.normal())};
    sought.height = rng.uniform(300, 900);  // as learnt from afar
    const auto fitted = fit_spots(image, {&sought, 1}, narrow, Vector2::Zero(), {});
    if (!fitted) continue;
    ++placed;
    // The light is wider than was learnt: the model's error, not the noise's.
    EXPECT_LT((fitted->uv[0] - uv).norm(), 0.5) << run;
    EXPECT_GT(fitted->information(0, 0), 1) << run;
  }
  EXPECT_GT(placed, kRuns / 20);
}

TEST(SpotFit, PlacesLightsThatRunTogether) {
  Rng rng(1);
  for (int count = 1; count <= kMaxGroup; ++count) {
    for (const double apart : {2.5, 4.0}) {
      double square = 0;
      int found = 0;
      constexpr int kRuns = 100;
      for (int run = 0; run < kRuns; ++run) {
        const Lights lights = draw(count, apart, rng);
        const auto fitted = fit(lights, static_cast<std::uint64_t>(run + 1), 0.3);
        if (!fitted) continue;
        ++found;
        for (int k = 0; k < count; ++k) {
          const auto n = static_cast<std::size_t>(k);
          square += (fitted->uv[n] - lights.uv[n]).squaredNorm() / (2 * count);
        }
      }
      EXPECT_GE(found, 98) << count << " lights " << apart << " px apart";
      EXPECT_LT(std::sqrt(square / found), 0.06) << count << " " << apart;
    }
  }
}

TEST(SpotFit, TheInformationIsThatOfTheErrors) {
  // The mean of e' I e over its dimensions, which noise makes 1. What it allows for
  // besides (shot noise, a model that is not exact) makes it less here.
  Rng rng(2);
  double sum = 0;
  int count = 0;
  for (int run = 0; run < 300; ++run) {
    const Lights lights = draw(2, 3, rng);
    const auto fitted = fit(lights, static_cast<std::uint64_t>(run + 1), 0.2);
    if (!fitted) continue;
    Eigen::Vector4d e;
    e << fitted->uv[0] - lights.uv[0], fitted->uv[1] - lights.uv[1];
    sum += e.dot(fitted->information * e) / std::max(fitted->chi2_per_pixel, 1e-3) / 4;
    ++count;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
        Eigen::MatrixXd(fitted->information));
    EXPECT_GT(eigen.eigenvalues().minCoeff(), 0);
  }
  EXPECT_GT(count, 290);
  EXPECT_GT(sum / count, 0.3);
  EXPECT_LT(sum / count, 3);
}

TEST(SpotFit, FullPixelsDoNotPull) {
  // Three times over the sensor's range, on grey pictures, where nothing else helps.
  Rng rng(3);
  double square = 0;
  int found = 0;
  constexpr int kRuns = 100;
  for (int run = 0; run < kRuns; ++run) {
    Lights lights = draw(1, 0, rng);
    lights.height[0] = 800;
    const auto fitted = fit(lights, static_cast<std::uint64_t>(run + 1), 0.3, 1);
    if (!fitted) continue;
    ++found;
    square += (fitted->uv[0] - lights.uv[0]).squaredNorm() / 2;
  }
  EXPECT_GE(found, 95);
  EXPECT_LT(std::sqrt(square / found), 0.06);
}

TEST(SpotFit, ALoneLightMoreThanHalfFullIsLeftToItsBlob) {
  // Its rim alone says less than its middle; lights that run together have no middles.
  Rng rng(12);
  constexpr int kRuns = 50;
  int left = 0, told_apart = 0;
  for (int run = 0; run < kRuns; ++run) {
    Lights alone = draw(1, 0, rng), two = draw(2, 3, rng);
    alone.height[0] = 1700;
    two.height[0] = two.height[1] = 1000;
    Picture picture(1, 100, 80);
    picture.add(alone.uv[0], LedColor::green, alone.height[0], kSd);
    const ImageView image = picture.expose(rng);
    const std::vector<LightSought> start = {{alone.uv[0]}};
    if (!fit_spots(image, start, kSpread, Vector2::Zero(), {})) ++left;
    if (fit(two, static_cast<std::uint64_t>(run + 1), 0.2, 1)) ++told_apart;
  }
  EXPECT_GE(left, 45);
  EXPECT_GE(told_apart, 45);
}

TEST(SpotFit, FindsTheWidthOfThePointSpread) {
  Rng rng(4);
  double mean = 0;
  constexpr int kRuns = 50;
  for (int run = 0; run < kRuns; ++run) {
    const Lights lights = draw(1, 0, rng);
    const auto fitted = fit(lights, static_cast<std::uint64_t>(run + 1), 0.2, 3, 1.15);
    ASSERT_TRUE(fitted);
    EXPECT_GT(fitted->variance_information, 0);
    mean += fitted->variance_px2 / kRuns;
  }
  EXPECT_GT(mean, 1.1);  // from 1 towards 1.32, which it is told to be off by 10 %
  EXPECT_LT(mean, 1.4);
}

/// A light as lenses draw it: most within a Gaussian, the rest in a wide skirt.
void add_with_skirt(Picture& picture, const Vector2& uv, double height, double skirt) {
  picture.add(uv, LedColor::white, height, kSd);
  picture.add(uv, LedColor::white, skirt * height,
              kSd * std::sqrt(PointSpread::kSkirtUsual));
}

TEST(SpotFit, ALightBesideDoesNotPull) {
  Rng rng(6);
  PointSpread with_skirt = kSpread;
  with_skirt.skirt = 0.06;
  constexpr int kRuns = 100;
  for (const double apart : {3.5, 4.5, 6.0}) {
    double known = 0, unknown = 0;
    for (int run = 0; run < kRuns; ++run) {
      Picture picture(3, 100, 80);
      const Vector2 uv(50 + rng.uniform(), 40 + rng.uniform());
      const Vector2 towards(std::cos(run), std::sin(run));
      const LightBeside other{uv + apart * towards, rng.uniform(120, 200)};
      add_with_skirt(picture, uv, 180, with_skirt.skirt);
      add_with_skirt(picture, other.uv, other.height, with_skirt.skirt);
      const ImageView image = picture.expose(rng);
      const std::vector<LightSought> starts = {{uv}};
      const auto apart_from_it =
          fit_spots(image, starts, with_skirt, Vector2::Zero(), {}, {&other, 1});
      const auto alone = fit_spots(image, starts, kSpread, Vector2::Zero(), {});
      ASSERT_TRUE(apart_from_it);
      known += towards.dot(apart_from_it->uv[0] - uv) / kRuns;
      if (alone) unknown += towards.dot(alone->uv[0] - uv) / kRuns;
    }
    EXPECT_LT(std::abs(known), 0.005) << apart;
    if (apart < 5) {
      EXPECT_GT(unknown, 0.03) << apart;
    }
  }
}

// A skirt is wider than its light: the same way makes it wider by less.
TEST(SpotFit, OfLightsThatMoveTheSkirtsDoNotPullEither) {
  Rng rng(12);
  PointSpread with_skirt = kSpread;
  with_skirt.skirt = 0.06;
  constexpr int kRuns = 200, kInstants = 12;
  for (const double apart : {4.0, 5.0, 6.0}) {
    double pulled = 0;
    for (int run = 0; run < kRuns; ++run) {
      Picture picture(3, 100, 80);
      const Vector2 uv(50 + rng.uniform(), 40 + rng.uniform());
      const Vector2 towards(std::cos(run), std::sin(run));
      const Vector2 blur = 2.5 * towards;
      const Vector2 other = uv + apart * towards;
      for (int k = 0; k < kInstants; ++k) {
        const Vector2 moved = ((k + 0.5) / kInstants - 0.5) * blur;
        add_with_skirt(picture, uv + moved, 240.0 / kInstants, with_skirt.skirt);
        add_with_skirt(picture, other + moved, 240.0 / kInstants, with_skirt.skirt);
      }
      const ImageView image = picture.expose(rng);
      const std::vector<LightSought> starts = {{uv}, {other}};
      const auto fitted = fit_spots(image, starts, with_skirt, blur, {});
      ASSERT_TRUE(fitted);
      pulled += towards.dot(fitted->uv[0] - uv - (fitted->uv[1] - other)) / 2 / kRuns;
    }
    EXPECT_LT(std::abs(pulled), 0.005) << apart;
  }
}

TEST(SpotFit, FindsTheSkirt) {
  Rng rng(8);
  for (const double skirt : {0.0, 0.03, 0.08}) {
    SkirtLook all;
    for (int run = 0; run < 30; ++run) {
      Picture picture(3, 100, 80);
      const LightBeside lights[] = {{{50 + rng.uniform(), 40 + rng.uniform()}, 180},
                                    {{54 + rng.uniform(), 42 + rng.uniform()}, 130}};
      for (const LightBeside& light : lights) {
        add_with_skirt(picture, light.uv, light.height, skirt);
      }
      const ImageView image = picture.expose(rng);
      const auto found = look_at_skirt(image, lights[0].uv, lights, kSpread);
      ASSERT_TRUE(found);
      all.information += found->information;
      all.pull += found->pull;
    }
    EXPECT_NEAR(all.pull[0] / all.information(0, 0), skirt, 0.005);
    EXPECT_EQ(all.information(1, 1), 0) << "no width of no skirt";
  }
  Picture picture(3, 100, 80);
  const LightBeside at_the_edge{{3, 40}, 100};
  const ImageView image = picture.expose(rng);
  EXPECT_FALSE(look_at_skirt(image, at_the_edge.uv, {&at_the_edge, 1}, kSpread));
}

// What an edge leaves of a light is none; a light that is full everywhere may be one.
TEST(SpotFit, SaysWhetherWhatItFindsIsUnlikeALight) {
  Rng rng(11);
  const Vector2 uv(50.3, 39.8);
  const struct {
    double peak, sd;
    int covered_to;  // column
    bool found, unlike;
  } cases[] = {
      {200, 1, 0, true, false}, {700, 1, 51, false, true}, {4000, 4, 0, false, false}};
  for (const auto& c : cases) {
    SCOPED_TRACE(c.peak);
    Picture picture(3, 100, 80);
    picture.add(uv, LedColor::green, c.peak, c.sd);
    (void)picture.expose(rng);
    if (c.covered_to > 0) picture.cover_left_of(c.covered_to, uv, 20);
    bool unlike = !c.unlike;
    const LightSought sought{uv};
    EXPECT_EQ(fit_spots(picture.view(), {&sought, 1}, kSpread, Vector2::Zero(), {}, {},
                        &unlike)
                  .has_value(),
              c.found);
    EXPECT_EQ(unlike, c.unlike);
  }
}

constexpr Mosaic kMosaics[] = {Mosaic::rggb, Mosaic::bggr, Mosaic::grbg, Mosaic::gbrg};

/// As a camera under a mosaic takes it: one colour a pixel, the others interpolated.
ImageView under_mosaic(Picture& picture, Mosaic mosaic) {
  std::vector<std::uint8_t> raw(picture.bytes.size() / 3);
  take_own_colors(picture.bytes.data(), picture.width, picture.height, mosaic,
                  raw.data());
  interpolate_colors(raw.data(), picture.width, picture.height, mosaic,
                     picture.bytes.data());
  ImageView image = picture.view();
  image.mosaic = mosaic;
  return image;
}

TEST(SpotFit, UnderAMosaicLightsStandWhereTheirPixelsSayAndNotTheirNeighbours) {
  constexpr LedColor kColors[] = {LedColor::red, LedColor::green, LedColor::blue};
  constexpr int kRuns = 240;
  for (const int count : {1, 2}) {
    Rng rng(21);
    double own2 = 0, luminance2 = 0, nees = 0, chi2 = 0;
    int fitted = 0;
    for (int run = 0; run < kRuns; ++run) {
      Picture picture(3, 100, 80);
      const LedColor color = kColors[run % 3];
      const Lights lights = draw(count, 4, rng);
      for (std::size_t i = 0; i < lights.uv.size(); ++i) {
        picture.add(lights.uv[i], color, lights.height[i], kSd);
      }
      (void)picture.expose(rng);
      ImageView image = under_mosaic(picture, kMosaics[run % 4]);
      std::vector<LightSought> sought;
      for (const Vector2& uv : lights.uv) {
        sought.push_back({uv + 0.3 * Vector2(rng.normal(), rng.normal())});
      }
      // Once their colour is known, as it is after a few pictures.
      const auto seen = fit_spots(image, sought, kSpread, Vector2::Zero(), {});
      if (count == 1 && seen) sought[0].color = seen->color;
      const auto own = fit_spots(image, sought, kSpread, Vector2::Zero(), {});
      image.mosaic = Mosaic::none;
      const auto luminance = fit_spots(image, sought, kSpread, Vector2::Zero(), {});
      ASSERT_TRUE(own) << run;
      ++fitted;
      Eigen::VectorXd e(2 * count);
      for (std::size_t i = 0; i < lights.uv.size(); ++i) {
        e.segment<2>(2 * static_cast<Eigen::Index>(i)) = own->uv[i] - lights.uv[i];
        if (luminance) luminance2 += (luminance->uv[i] - lights.uv[i]).squaredNorm();
      }
      own2 += e.squaredNorm();
      nees += e.dot(own->information * e);
      chi2 += own->chi2_per_pixel;
    }
    const double images = 2.0 * count * fitted;
    EXPECT_LT(std::sqrt(own2 / images), count == 1 ? 0.04 : 0.08) << count;
    EXPECT_GT(luminance2, 9 * own2) << count;
    // As exact as is claimed, within what a colour that is told by the same pixels
    // costs.
    EXPECT_LT(nees / images, 2 * chi2 / fitted) << count;
    EXPECT_GT(nees / images, 0.5 * chi2 / fitted) << count;
  }
}

TEST(SpotFit, TellsTheColourOfALightUnderAMosaic) {
  Rng rng(22);
  for (const Mosaic mosaic : kMosaics) {
    Picture picture(3, 100, 80);
    const Vector2 uv(50 + rng.uniform(), 40 + rng.uniform());
    picture.add(uv, LedColor::red, 200, kSd);  // 0.25, 0.2, 1
    (void)picture.expose(rng);
    const LightSought sought{uv};
    const auto found = fit_spots(under_mosaic(picture, mosaic), {&sought, 1}, kSpread,
                                 Vector2::Zero(), {});
    ASSERT_TRUE(found);
    const double luminance = 0.114 * 0.25 + 0.587 * 0.2 + 0.299;
    EXPECT_NEAR(found->color[0], 0.25 / luminance, 0.15);
    EXPECT_NEAR(found->color[1], 0.2 / luminance, 0.15);
    EXPECT_NEAR(found->color[2], 1 / luminance, 0.15);
    EXPECT_NEAR(found->height[0], 200 * luminance, 10);
  }
}

TEST(SpotFit, UnderAMosaicALightBesideOfAnotherColourDoesNotPull) {
  Rng rng(23);
  constexpr int kRuns = 100;
  const LightColor green{0.3f / 0.681f, 1 / 0.681f, 0.2f / 0.681f};
  double pull = 0;
  for (int run = 0; run < kRuns; ++run) {
    Picture picture(3, 100, 80);
    const Vector2 uv(50 + rng.uniform(), 40 + rng.uniform());
    const Vector2 towards(std::cos(run), std::sin(run));
    const Vector2 other_uv = uv + 3.5 * towards;
    picture.add(uv, LedColor::red, 180, kSd);
    picture.add(other_uv, LedColor::green, 180, kSd);
    (void)picture.expose(rng);
    const LightSought sought{uv};
    const LightBeside other{other_uv, 180 * 0.681, green};
    const auto found = fit_spots(under_mosaic(picture, kMosaics[run % 4]), {&sought, 1},
                                 kSpread, Vector2::Zero(), {}, {&other, 1});
    ASSERT_TRUE(found);
    pull += towards.dot(found->uv[0] - uv) / kRuns;
  }
  EXPECT_LT(std::abs(pull), 0.03);
}

TEST(SpotFit, RefusesWhatIsNotThere) {
  Rng rng(5);
  Picture picture(3, 100, 80);
  picture.add({50, 40}, LedColor::red, 200, 1);
  const ImageView image = picture.expose(rng);
  const auto at = [&](const Vector2& uv, std::span<const ForeignLight> foreign = {}) {
    const LightSought starts[] = {{uv}};
    return fit_spots(image, starts, kSpread, Vector2::Zero(), foreign);
  };
  EXPECT_TRUE(at({50.3, 39.8}));
  EXPECT_FALSE(at({1, 40}));    // over the edge
  EXPECT_FALSE(at({1e9, 40}));  // far outside
  EXPECT_FALSE(at({std::nan(""), 40}));
  const ForeignLight taken{.box = {40, 30, 60, 50}};
  EXPECT_FALSE(at({50, 40}, {&taken, 1}));  // somebody else's
  const auto dark = at({30, 20});
  EXPECT_TRUE(!dark || dark->height[0] < 12);
}

}  // namespace
}  // namespace alight
