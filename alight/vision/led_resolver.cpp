#include "alight/vision/led_resolver.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "alight/base/bounds.h"
#include "alight/base/median.h"

namespace alight {
namespace {

constexpr double kDark = 0.08;        // share of the brightest that is no light
constexpr double kVagueSd = 3;        // px; an LED less well placed is not seen
constexpr double kForeignReach = 40;  // px
constexpr double kNoiseUsual = PointSpread{}.noise_variance;  // of most cameras
constexpr double kDimLeast = 12;      // grey levels of an LED without a blob, with it
constexpr std::size_t kSureLeds = 3;  // with blobs of their own, before dim ones count
constexpr double kGoodChi2 = 3;       // per pixel; a worse fit is tried again
// An LED that has given no light for so many pictures is not looked for in others'
// light, of which noise would make it, unless this many times the usual chi2 are left.
constexpr int kDeadAfter = 30;
constexpr double kUnexplained = 2;
constexpr double kStrangerReach = 15;                // px around the constellation
constexpr double kNoiseLeast = 0.1, kNoiseMost = 4;  // of chi2 per pixel
// From so many times its usual value on it is no noise: the edge of something that
// covers part of a light leaves residuals side by side, which pull it by as much more,
// at most.
constexpr double kEdge = 4, kEdgePull2 = 6;
// What a model of lights lacks moves those that run together: the variance of their
// places, by that of lights with as much noise alone.
constexpr double kTogether = 1.35;
// An edge covers parts of so many LEDs at once; where more are unlike LEDs they are
// blurred, all of them, and their middles still tell.
constexpr int kCoveredAtOnce = 2;
constexpr int kHoldMargin = 1;        // px around a lamp that its light reaches
constexpr double kHoldGate = 3;       // standard deviations, besides
constexpr double kHoldSlack = 0.4;    // px
constexpr double kHoldPlaceSd = 0.5;  // px; a worse place may be a lamp's doing
constexpr double kHoldChi2 = 3;       // per pixel, times what is usual
constexpr double kHoldHeight = 2.5;   // factor by which an LED's light may change
constexpr double kFull = 200;         // grey levels; brighter LEDs may look white
constexpr double kSpreadLeast = 0.3, kSpreadMost = 9;  // px^2
// Skirts of lights farther off do not matter,
constexpr double kBesidePx = 9;
// and of those farther than this not exactly where they stand. Nearer ones that turn
// out to be so far from where they were expected, or so much brighter or dimmer, are
// taken off anew.
constexpr double kNearPx = 6, kMovedPx = 0.15, kChanged = 0.3;
constexpr int kSkirtEvery = 4;    // pictures, once it is known
constexpr double kSkirtBlur = 1;  // px; a longer streak has another skirt
constexpr int kColorMemory = 30;  // times an LED is seen alone
constexpr int kLampReach = 3;     // px around a lamp that its light reaches
// A light of its own is about as long as wide, in px^2 of variance, once its way during
// the exposure is taken off; noise makes a small one longer than that.
constexpr double kLongest = 2.5, kLongLeast = 1.5;

/// Takes the LEDs for which `keep` is false out of the information, the rest being
/// told without them.
GroupMatrix marginal(const GroupMatrix& information, std::span<const int> keep) {
  const auto n = static_cast<Eigen::Index>(keep.size());
  const Eigen::Index all = information.rows() / 2;
  if (n == all) return information;
  FixedVector<int, kMaxGroup> drop;
  for (int i = 0; i < static_cast<int>(all); ++i) {
    if (std::find(keep.begin(), keep.end(), i) == keep.end()) drop.push_back(i);
  }
  const auto block = [&](std::span<const int> rows, std::span<const int> columns) {
    GroupMatrix out(2 * static_cast<Eigen::Index>(rows.size()),
                    2 * static_cast<Eigen::Index>(columns.size()));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      for (std::size_t j = 0; j < columns.size(); ++j) {
        out.block<2, 2>(2 * static_cast<Eigen::Index>(i),
                        2 * static_cast<Eigen::Index>(j)) =
            information.block<2, 2>(2 * rows[i], 2 * columns[j]);
      }
    }
    return out;
  };
  const std::span<const int> gone(drop.data(), drop.size());
  GroupMatrix H_dd = block(gone, gone);
  H_dd.diagonal().array() += 1e-6;
  const GroupMatrix H_kd = block(keep, gone);
  const Eigen::LLT<GroupMatrix> llt(H_dd);
  return block(keep, keep) - H_kd * llt.solve(H_kd.transpose());
}

/// All of its box; with a margin what its shape covers, lamps in a row taken for a bar.
ForeignLight foreign_light(const Blob& blob, int margin_px) {
  ForeignLight light{.box = blob.box};
  if (margin_px == 0) return light;
  light.box = {blob.box.u0 - margin_px, blob.box.v0 - margin_px,
               blob.box.u1 + margin_px, blob.box.v1 + margin_px};
  light.middle = blob.uv;
  const Vector2 stretch = stretch_of(blob.spread);
  const double turn = 0.5 * std::atan2(stretch.y(), stretch.x());
  light.along = Vector2(std::cos(turn), std::sin(turn));
  const double mean = 0.5 * blob.spread.trace(), half = 0.5 * stretch.norm();
  // An even bar reaches sqrt(3) standard deviations, its rim is dim.
  light.half_length = std::sqrt(3 * std::max(mean + half, 0.0)) + 1 + margin_px;
  light.half_width = std::sqrt(3 * std::max(mean - half, 0.0)) + 1 + margin_px;
  return light;
}

/// A light that is as large as an LED near the lens, and run together with a lamp: its
/// middle is that of neither.
bool runs_on(const Blob& blob, const Vector2& blur_px) {
  const Vector2 stretch =
      stretch_of(blob.spread) - stretch_of(blur_px * blur_px.transpose() / 12);
  const double half = 0.5 * stretch.norm();
  const double narrow = 0.5 * (blob.spread.trace() - blur_px.squaredNorm() / 12) - half;
  return 2 * half > std::max((kLongest - 1) * narrow, kLongLeast);
}

bool is_used(const Assignment& match, int blob) {
  return std::find(match.blob.begin(), match.blob.end(), blob) != match.blob.end();
}

RefusedBlob unmatched(const Blob& blob) {
  return {blob.uv, blob.stray ? Refusal::stray : Refusal::no_led_near};
}

}  // namespace

Result<void> LedResolverConfig::validate() const {
  return check_bounds({{"resolver.area_max_px", area_max_px, 0, 1e4},
                       {"resolver.touch", touch, 0.5, 4},
                       {"resolver.dim_reach_px", dim_reach_px, 0, 10},
                       {"resolver.sd_floor_px", sd_floor_px, 1e-3, 10},
                       {"resolver.spread_sd_px", spread_sd_px, 0.5, 3},
                       {"resolver.spread_share", spread_share, 0.01, 1},
                       {"resolver.spread_memory", spread_memory, 1, 1e6}});
}

/// LEDs whose images touch.
struct LedResolver::Patch {
  Patch() {}  // Leaves the room for a fit as it is: a list of patches is large.

  FixedVector<int, kMaxLeds> members;
  double area_px = 0;    ///< Of the largest of its blobs; 0: none.
  bool unlike = false;   ///< Nothing like its LEDs was found in it.
  unsigned feigned = 0;  ///< Members that only noise shows.
  std::optional<SpotFit> fit;
};

/// A picture with what is known of its lights.
struct LedResolver::Look {
  const ImageView& image;
  BlobSpan blobs;
  const Assignment& match;
  const LedImages& images;
  std::span<const Vector2> blur_px;
  int margin_px;                               ///< Around lamps.
  std::array<LightBeside, kMaxLeds> lights{};  ///< Of the LEDs; height 0: none known.
};

Result<LedResolver> LedResolver::create(const LedResolverConfig& config,
                                        const Camera& camera,
                                        const Constellation& leds) {
  if (const auto valid = config.validate(); !valid) return fail(valid.error());
  return LedResolver(config, camera, leds);
}

LedResolver::LedResolver(const LedResolverConfig& config, const Camera& camera,
                         const Constellation& leds)
    : config_(config),
      camera_(camera),
      leds_(leds),
      spread_{config.spread_sd_px * config.spread_sd_px, config.spread_share} {}

void LedResolver::forget_lights() {
  LedResolver anew(config_, camera_, leds_);
  anew.lit_ = lit_;
  anew.dark_ = dark_;
  anew.spread_.noise_variance = spread_.noise_variance;
  *this = anew;
}

void LedResolver::set_noise(const PictureNoise& noise) {
  spread_.noise_variance = std::max(kNoiseUsual, noise.luminance_variance);
}

void LedResolver::learn(const Patch& patch) {
  if (!patch.fit) return;
  const SpotFit& fit = *patch.fit;
  for (std::size_t k = 0; k < patch.members.size(); ++k) {
    heights_[static_cast<std::size_t>(patch.members[k])] = fit.height[k];
  }
  if (fit.count == 1 && known(fit.color)) learn_color(patch.members[0], fit.color);
  // How large residuals are that this camera leaves: its noise, and what the model of
  // a light lacks.
  judged_ = std::min(judged_ + 1, config_.spread_memory);
  noise_ +=
      (std::clamp(fit.chi2_per_pixel, kNoiseLeast, kNoiseMost) - noise_) / judged_;
}

void LedResolver::learn_color(int led, const LightColor& color) {
  const auto i = static_cast<std::size_t>(led);
  colors_seen_[i] = std::min(colors_seen_[i] + 1, kColorMemory);
  for (std::size_t c = 0; c < color.size(); ++c) {
    colors_[i][c] += (color[c] - colors_[i][c]) / static_cast<float>(colors_seen_[i]);
  }
  if (colors_seen_[i] > 1) return;
  // LEDs that are written down alike look alike, until they have been looked at.
  for (int k = 0; k < leds_.size(); ++k) {
    const auto n = static_cast<std::size_t>(k);
    if (colors_seen_[n] == 0 && !known(colors_[n]) &&
        leds_.color(k) == leds_.color(led)) {
      colors_[n] = colors_[i];
    }
  }
}

void LedResolver::compare_lights(const Look& look, const Patches& patches,
                                 const Pose& X_NB) {
  LightShare::Heights heights{}, areas_px{};
  for (const Patch& patch : patches) {
    for (std::size_t k = 0; k < patch.members.size(); ++k) {
      const auto i = static_cast<std::size_t>(patch.members[k]);
      const int j = look.match.blob[i];
      if (patch.fit) {
        heights[i] = patch.fit->height[k];
      } else if (j >= 0 && patch.members.size() == 1) {
        const Blob& blob = look.blobs[static_cast<std::size_t>(j)];
        if (!runs_on(blob, look.blur_px[i])) areas_px[i] = blob.area_px;
      }
    }
  }
  const double range_m = (X_NB.translation() - camera_.X_NC.translation()).norm();
  share_.look(heights, range_m);
  area_share_.look(areas_px, range_m);
}

Matrix2 LedResolver::displacement(int led, const Blob& blob) const {
  // An even disc has half its radius for standard deviation.
  const double off =
      area_share_.displaced_px(led, std::sqrt(blob.area_px / std::numbers::pi) / 2);
  return off * off * Matrix2::Identity();
}

void LedResolver::learn_spread(const Patch& patch) {
  if (!patch.fit) return;
  const SpotFit& fit = *patch.fit;
  if (!(fit.variance_information > 0)) return;
  const double own = 1 / fit.variance_information;  // variance of what it found
  const double share = config_.spread_share * spread_.variance_px2;
  if (own > share * share) return;
  known_ = std::min(known_ + 1, config_.spread_memory);
  spread_.variance_px2 += (fit.variance_px2 - spread_.variance_px2) / (known_ + 1);
  spread_.variance_px2 = std::clamp(spread_.variance_px2, kSpreadLeast, kSpreadMost);
  // Lights differ by their distance and brightness: it is never known exactly.
  spread_.share_sd = std::max(config_.spread_share / std::sqrt(known_ + 1), 0.08);
}

void LedResolver::add(const Patch& patch, BlobSpan blobs, const Assignment& match,
                      LedFrame& out) const {
  const SpotFit& fit = *patch.fit;
  const Eigen::Index n = 2 * fit.count;
  double brightest = 0;
  for (int k = 0; k < fit.count; ++k) {
    brightest = std::max(brightest, fit.height[static_cast<std::size_t>(k)]);
  }
  const auto marginals = [](const GroupMatrix& information) {
    GroupMatrix regular = information;
    regular.diagonal().array() += 1e-2;  // 10 px: known from elsewhere
    if (regular.rows() == 2) return GroupMatrix(Matrix2(regular).inverse());
    const Eigen::LLT<GroupMatrix> llt(regular);
    return GroupMatrix(
        llt.solve(GroupMatrix::Identity(information.rows(), information.cols())));
  };
  const double usual = std::max(noise_, kNoiseLeast);
  const double pull2 =
      std::clamp(fit.chi2_per_pixel / (kEdge * usual), 1.0, kEdgePull2);
  const double usual_here = fit.count > 1 ? kTogether * usual : usual;
  GroupMatrix measured =
      fit.information / (pull2 * std::max(fit.chi2_per_pixel, usual_here));
  const double spread_px = std::sqrt(spread_.variance_px2);
  for (int k = 0; k < fit.count; ++k) {
    const double off =
        share_.displaced_px(patch.members[static_cast<std::size_t>(k)], spread_px);
    if (off == 0) continue;
    // The light's own rows and columns, as if its place varied by so much more.
    const double share =
        1 / std::sqrt(1 + off * off * measured.diagonal().segment<2>(2 * k).mean());
    measured.middleRows<2>(2 * k) *= share;
    measured.middleCols<2>(2 * k) *= share;
  }
  const GroupMatrix cov_all = marginals(measured);
  FixedVector<int, kMaxGroup> keep;
  for (int k = 0; k < fit.count; ++k) {
    const double variance = cov_all(2 * k, 2 * k) + cov_all(2 * k + 1, 2 * k + 1);
    if (fit.height[static_cast<std::size_t>(k)] > kDark * brightest &&
        ((patch.feigned >> k) & 1) == 0 && variance < 2 * kVagueSd * kVagueSd) {
      keep.push_back(k);
    }
  }
  if (keep.empty()) return;
  GroupMatrix information = marginal(measured, {keep.data(), keep.size()});
  const GroupMatrix cov =
      keep.size() == static_cast<std::size_t>(n / 2) ? cov_all : marginals(information);
  OverlappingLeds group;
  group.first = static_cast<int>(out.seen.size());
  group.count = static_cast<int>(keep.size());
  for (std::size_t m = 0; m < keep.size(); ++m) {
    const auto at = static_cast<Eigen::Index>(2 * m);
    const int led = patch.members[static_cast<std::size_t>(keep[m])];
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << led);
    o.uv = fit.uv[static_cast<std::size_t>(keep[m])];
    o.cov = cov.block<2, 2>(at, at) +
            config_.sd_floor_px * config_.sd_floor_px * Matrix2::Identity();
    const int j = match.blob[static_cast<std::size_t>(led)];
    if (j >= 0) o.depth_m = blobs[static_cast<std::size_t>(j)].depth_m;
    out.seen.push_back(o);
  }
  if (group.count < 2) return;
  group.information = information;
  out.groups.push_back(group);
}

LedResolver::Look LedResolver::look_at(const ImageView& image, BlobSpan blobs,
                                       const Assignment& match, const LedImages& images,
                                       std::span<const Vector2> blur_px,
                                       int margin_px) const {
  Look look{image, blobs, match, images, blur_px, margin_px};
  for (int i = 0; i < leds_.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    if (images.in_front[n] && ((lit_ >> i) & 1)) {
      look.lights[n] = {images.uv[n], heights_[n], colors_[n]};
    }
  }
  return look;
}

template <class Wanted>
void LedResolver::fit_all(Look& look, Patches& patches, Wanted&& wanted) const {
  const auto expected = look.lights;
  for (Patch& patch : patches) {
    if (wanted(patch)) fit(look, patch);
  }
  const auto changed = [&](std::size_t i) {
    const LightBeside &now = look.lights[i], &then = expected[i];
    return (now.uv - then.uv).norm() > kMovedPx ||
           std::abs(now.height - then.height) > kChanged * now.height;
  };
  for (std::size_t p = 0; p < patches.size(); ++p) {
    Patch& patch = patches[p];
    if (!patch.fit || !wanted(patch)) continue;
    bool again = false;
    // Those before it were known when it was fitted.
    for (std::size_t q = p + 1; q < patches.size(); ++q) {
      for (const int other : patches[q].members) {
        const auto i = static_cast<std::size_t>(other);
        for (const int own : patch.members) {
          const auto k = static_cast<std::size_t>(own);
          again = again || (changed(i) &&
                            (look.lights[i].uv - look.lights[k].uv).norm() < kNearPx);
        }
      }
    }
    if (again) fit(look, patch);
  }
}

template <class Wanted>
LedResolver::Patches LedResolver::fitted(Look& look, Wanted&& wanted) const {
  const auto expected = look.lights;
  bool left_out = false;
  Patches patches = this->patches(look.images, look.blobs, look.match, &left_out);
  fit_all(look, patches, wanted);
  const auto fails = [&](const Patch& p) { return wanted(p) && unexplained(p); };
  if (left_out && std::any_of(patches.begin(), patches.end(), fails)) {
    patches = this->patches(look.images, look.blobs, look.match, nullptr);
    look.lights = expected;
    fit_all(look, patches, wanted);
  }
  return patches;
}

void LedResolver::fit(Look& look, Patch& patch) const {
  const Assignment& match = look.match;
  const BlobSpan blobs = look.blobs;
  const auto count = static_cast<double>(patch.members.size());
  if (patch.members.size() > kMaxGroup) return;
  if (patch.area_px > config_.area_max_px * count) return;
  FixedVector<LightSought, kMaxGroup> sought;
  Vector2 blur = Vector2::Zero();
  for (const int i : patch.members) {
    const auto n = static_cast<std::size_t>(i);
    sought.push_back({look.images.uv[n], heights_[n], colors_[n]});
    blur += look.blur_px[n] / count;
  }
  const int first = match.blob[static_cast<std::size_t>(patch.members[0])];
  if (sought.size() == 1 && first >= 0) {
    sought[0].uv = blobs[static_cast<std::size_t>(first)].uv;
  }
  FixedVector<ForeignLight, 32> foreign;
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    if ((blobs[j].uv - sought[0].uv).cwiseAbs().maxCoeff() > kForeignReach) continue;
    if (is_used(match, static_cast<int>(j))) continue;
    foreign.push_back(foreign_light(blobs[j], look.margin_px));
  }
  FixedVector<LightBeside, kMaxLeds> beside;
  for (int i = 0; i < leds_.size(); ++i) {
    const LightBeside& light = look.lights[static_cast<std::size_t>(i)];
    if (!(light.height > 0) || std::find(patch.members.begin(), patch.members.end(),
                                         i) != patch.members.end()) {
      continue;
    }
    const auto near = [&](const LightSought& own) {
      return (own.uv - light.uv).norm() < kBesidePx;
    };
    if (std::any_of(sought.begin(), sought.end(), near)) beside.push_back(light);
  }
  auto found = fit_spots(look.image, {sought.data(), sought.size()}, spread_, blur,
                         {foreign.data(), foreign.size()},
                         {beside.data(), beside.size()}, &patch.unlike);
  if (!found) return;
  unsigned too_dim = 0;
  if (patch.area_px == 0) {
    const double least = kDimLeast * std::sqrt(spread_.noise_variance / kNoiseUsual);
    for (std::size_t k = 0; k < sought.size(); ++k) {
      if (found->height[k] < least ||
          (found->uv[k] - sought[k].uv).norm() > config_.dim_reach_px) {
        too_dim |= 1u << k;
      }
    }
    if (too_dim == (1u << sought.size()) - 1) return;
  }
  if (patch.fit && found->chi2_per_pixel > patch.fit->chi2_per_pixel) return;
  patch.fit = found;
  patch.feigned = too_dim | feigned(patch, {sought.data(), sought.size()});
  for (std::size_t k = 0; k < patch.members.size(); ++k) {
    const auto n = static_cast<std::size_t>(patch.members[k]);
    look.lights[n] = {found->uv[k], found->height[k], sought[k].color};
    if (!known(sought[k].color)) look.lights[n].color = found->color;
  }
}

unsigned LedResolver::feigned(const Patch& patch,
                              std::span<const LightSought> sought) const {
  const auto was_lit = [&](std::size_t k) { return (lit_ >> patch.members[k]) & 1; };
  const auto off = [&](std::size_t k) {
    return Vector2(patch.fit->uv[k] - sought[k].uv);
  };
  Vector2 common = Vector2::Zero();
  int lit = 0;
  for (std::size_t k = 0; k < sought.size(); ++k) {
    if (!was_lit(k)) continue;
    common += off(k);
    ++lit;
  }
  unsigned out = 0;
  for (std::size_t k = 0; lit > 0 && k < sought.size(); ++k) {
    const bool elsewhere = (off(k) - common / lit).norm() > config_.dim_reach_px;
    if (!was_lit(k) && elsewhere) out |= 1u << k;
  }
  return out;
}

void LedResolver::learn_skirt(const Look& look, const Patches& patches) {
  ++pictures_;
  if (skirt_.settled() && pictures_ % kSkirtEvery != 0) return;
  next_ = (next_ + 1) % static_cast<std::size_t>(leds_.size());
  look_around(look, patches, next_);
}

void LedResolver::look_around(const Look& look, const Patches& patches,
                              std::size_t led) {
  const Vector2 middle = look.lights[led].uv;
  FixedVector<LightBeside, kMaxLeds> lights;
  bool seen = false;
  for (const Patch& patch : patches) {
    for (std::size_t k = 0; k < patch.members.size(); ++k) {
      const auto i = static_cast<std::size_t>(patch.members[k]);
      if (!patch.fit) {
        if ((look.images.uv[i] - middle).norm() < 2 * kSkirtBox) return;
        continue;
      }
      seen = seen || i == led;
      const LightBeside light{patch.fit->uv[k], patch.fit->height[k],
                              look.lights[i].color};
      if ((light.uv - middle).norm() < 3 * kSkirtBox) lights.push_back(light);
    }
  }
  if (!seen || look.blur_px[led].norm() > kSkirtBlur) return;
  for (std::size_t j = 0; j < look.blobs.size(); ++j) {
    const Roi& box = look.blobs[j].box;
    const int reach = kSkirtBox + kLampReach;
    const bool near = box.u0 < middle.x() + reach && box.u1 > middle.x() - reach &&
                      box.v0 < middle.y() + reach && box.v1 > middle.y() - reach;
    const auto& own = look.match.blob;
    if (near && std::find(own.begin(), own.end(), static_cast<int>(j)) == own.end()) {
      return;
    }
  }
  const auto found =
      look_at_skirt(look.image, middle, {lights.data(), lights.size()}, spread_);
  if (!found) return;
  skirt_.add(*found, spread_);
}

void LedResolver::learn_from(const Look& look, const Patches& patches) {
  for (const Patch& patch : patches) {
    learn(patch);
    learn_spread(patch);
  }
  learn_skirt(look, patches);
  share_.learn();
  area_share_.learn();
}

LedResolver::Patches LedResolver::patches(const LedImages& images, BlobSpan blobs,
                                          const Assignment& match,
                                          bool* left_out) const {
  const auto n = static_cast<std::size_t>(leds_.size());
  std::array<std::size_t, kMaxLeds> group;
  for (std::size_t i = 0; i < n; ++i) group[i] = i;
  const double touch = config_.touch * spot_reach_px(spread_, Vector2::Zero());
  const auto touching = [&](std::size_t i, std::size_t k) {
    const bool shared = match.blob[i] >= 0 && match.blob[i] == match.blob[k];
    return images.in_front[i] && images.in_front[k] &&
           (shared || (images.uv[i] - images.uv[k]).norm() <= touch);
  };
  const auto dead = [&](std::size_t i) { return dark_[i] >= kDeadAfter; };
  std::array<bool, kMaxLeds> looked_for;
  for (std::size_t i = 0; i < n; ++i) {
    looked_for[i] = images.in_front[i];
    for (std::size_t k = 0; left_out != nullptr && k < n; ++k) {
      if (!dead(i) || dead(k) || !touching(i, k)) continue;
      looked_for[i] = false;
      *left_out = true;
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      if (!looked_for[i] || !looked_for[k] || group[i] == group[k]) continue;
      if (!touching(i, k)) continue;
      const std::size_t from = group[i], to = group[k];
      for (std::size_t j = 0; j < n; ++j) {
        if (group[j] == from) group[j] = to;
      }
    }
  }
  Patches out;
  for (std::size_t g = 0; g < n; ++g) {
    Patch patch;
    for (std::size_t i = 0; i < n; ++i) {
      if (group[i] != g || !looked_for[i]) continue;
      patch.members.push_back(static_cast<int>(i));
      if (match.blob[i] < 0) continue;
      const Blob& blob = blobs[static_cast<std::size_t>(match.blob[i])];
      patch.area_px = std::max(patch.area_px, blob.area_px);
    }
    if (!patch.members.empty()) out.push_back(patch);
  }
  return out;
}

void LedResolver::resolve(const ImageView& image, BlobSpan blobs,
                          const TrackDetail& detail, std::span<const Vector2> blur_px,
                          LedFrame& frame) {
  const LedImages& images = detail.images;
  const Assignment& match = detail.match;

  // Patches with blobs first; what they say of the pose shows where to look for the
  // rest.
  bool all = true;
  const auto has_blob = [](const Patch& patch) { return patch.area_px > 0; };
  Look look = look_at(image, blobs, match, images, blur_px, 0);
  Patches patches = fitted(look, has_blob);
  if (judged_ == 0) {
    // What the first picture tells of the camera's lights, it tells of its own, too.
    for (const Patch& patch : patches) learn_spread(patch);
    for (std::size_t i = 0; i < static_cast<std::size_t>(leds_.size()); ++i) {
      look_around(look, patches, i);
    }
    fit_all(look, patches, has_blob);
    for (const Patch& patch : patches) learn(patch);
  }
  for (Patch& patch : patches) {
    all = all && patch.fit && patch.fit->chi2_per_pixel < kGoodChi2;
  }
  const auto collect = [&] {
    LedFrame out;
    const bool covered =
        std::count_if(patches.begin(), patches.end(), [&](const Patch& patch) {
          return misshapen(patch);
        }) <= kCoveredAtOnce;
    for (const Patch& patch : patches) {
      if (patch.fit) {
        add(patch, blobs, match, out);
        continue;
      }
      // Several LEDs in a blob that cannot be told apart: no place of any.
      for (const LedObservation& o : frame.seen) {
        const int first = std::countr_zero(o.leds);
        if (std::find(patch.members.begin(), patch.members.end(), first) !=
                patch.members.end() &&
            std::popcount(o.leds) == static_cast<int>(patch.members.size())) {
          const auto n = static_cast<std::size_t>(first);
          const int j = match.blob[n];
          if (patch.members.size() > 1 || j < 0) {
            out.seen.push_back(o);
            continue;
          }
          const Blob& blob = blobs[static_cast<std::size_t>(j)];
          if (runs_on(blob, blur_px[n]) || (covered && misshapen(patch))) continue;
          out.seen.push_back(o);
          out.seen.back().cov += displacement(first, blob);
        }
      }
    }
    return out;
  };
  compare_lights(look, patches, detail.X_NB_predicted);
  LedFrame out = collect();
  const bool sure = out.seen.size() >= kSureLeds;  // all of them have blobs so far
  if (!all && out.seen.size() >= 2) {
    const auto pose = refine_pose(camera_, leds_, {out.seen.data(), out.seen.size()},
                                  detail.X_NB_predicted, &detail.prior_information, 6);
    if (pose) {
      const LedImages again = led_images(camera_, leds_, pose->X_NB);
      Look anew{image, blobs, match, again, blur_px, 0, look.lights};
      for (Patch& patch : patches) {
        if (patch.fit && patch.fit->chi2_per_pixel < kGoodChi2) continue;
        if (patch.area_px == 0 && (patch.members.size() > 1 || !sure)) continue;
        fit(anew, patch);
      }
      compare_lights(look, patches, detail.X_NB_predicted);
      out = collect();
    }
  }
  learn_from(look, patches);
  for (const Patch& patch : patches) {
    const int j = match.blob[static_cast<std::size_t>(patch.members[0])];
    if (patch.fit || patch.members.size() > 1 || j < 0) continue;
    const Blob& blob = blobs[static_cast<std::size_t>(j)];
    if (runs_on(blob, blur_px[static_cast<std::size_t>(patch.members[0])])) {
      frame.refused.push_back({blob.uv, Refusal::too_large});
    }
  }
  frame.seen = out.seen;
  frame.groups = out.groups;
  std::uint16_t lit = 0;
  for (const LedObservation& o : out.seen) {
    if (std::has_single_bit(o.leds)) lit = static_cast<std::uint16_t>(lit | o.leds);
  }
  remember_lit(lit);
}

bool LedResolver::unexplained(const Patch& patch) const {
  // Where no light is, none is missing.
  if (!patch.fit) return patch.area_px > 0;
  return patch.fit->chi2_per_pixel > kUnexplained * std::max(noise_, kNoiseLeast);
}

void LedResolver::remember_lit(std::uint16_t lit) {
  lit_ = lit;
  for (std::size_t i = 0; i < static_cast<std::size_t>(leds_.size()); ++i) {
    dark_[i] = ((lit >> i) & 1) != 0 ? 0 : std::min(dark_[i] + 1, kDeadAfter);
  }
}

std::optional<LedFrame> LedResolver::follow(const ImageView& image, BlobSpan blobs,
                                            const Pose& X_NB_predicted, double gate_px,
                                            std::span<const Vector2> blur_px, Time t) {
  LedImages images = led_images(camera_, leds_, X_NB_predicted);
  if (images.count < leds_.size()) return std::nullopt;
  // What all have in common: the middle of the shifts of LEDs that stand alone.
  const auto nearest = [&](const Vector2& uv, double reach) {
    int best = -1;
    for (std::size_t j = 0; j < blobs.size(); ++j) {
      const double d = (blobs[j].uv - uv).norm();
      if (blobs[j].cut || d >= reach) continue;
      reach = d;
      best = static_cast<int>(j);
    }
    return best;
  };
  const double alone = config_.touch * spot_reach_px(spread_, Vector2::Zero());
  FixedVector<double, kMaxLeds> du, dv;
  for (int i = 0; i < leds_.size(); ++i) {
    const Vector2& uv = images.uv[static_cast<std::size_t>(i)];
    bool single = true;
    for (int k = 0; k < leds_.size() && single; ++k) {
      single = k == i || (images.uv[static_cast<std::size_t>(k)] - uv).norm() > alone;
    }
    const int j = single ? nearest(uv, gate_px) : -1;
    if (j < 0) continue;
    du.push_back(blobs[static_cast<std::size_t>(j)].uv.x() - uv.x());
    dv.push_back(blobs[static_cast<std::size_t>(j)].uv.y() - uv.y());
  }
  if (du.size() >= 2) {
    const Vector2 shift(median(du.begin(), du.end()), median(dv.begin(), dv.end()));
    for (Vector2& uv : images.uv) uv += shift;
    images.middle += shift;
  }

  // Every blob in reach of an LED is its own, or nobody's business here.
  Assignment match;
  for (int i = 0; i < leds_.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    const int j = nearest(images.uv[n], alone);
    if (j < 0) continue;
    const Blob& blob = blobs[static_cast<std::size_t>(j)];
    if (blob.stray) return std::nullopt;
    if (config_.use_color && !colors_agree(blob.color, leds_.color(i), true)) {
      return std::nullopt;
    }
    match.blob[n] = j;
  }
  // A lamp in front of an LED is seen in its place.
  FixedVector<double, kMaxLeds> areas;
  const bool all_lit = std::popcount(lit_) == leds_.size();
  for (const int j : match.blob) {
    if (j < 0) continue;
    // LEDs that run together share theirs; dark ones cover nothing.
    const auto sharing = std::count(match.blob.begin(), match.blob.end(), j);
    areas.push_back(blobs[static_cast<std::size_t>(j)].area_px /
                    static_cast<double>(all_lit ? sharing : 1));
  }
  if (areas.size() > 0 && *std::max_element(areas.begin(), areas.end()) >
                              kLargestImage * median(areas.begin(), areas.end())) {
    return std::nullopt;
  }
  LedFrame out;
  out.t = t;
  Look look = look_at(image, blobs, match, images, blur_px, 0);
  Patches patches = fitted(look, [](const Patch&) { return true; });
  compare_lights(look, patches, X_NB_predicted);
  for (Patch& patch : patches) {
    if (patch.fit) {
      add(patch, blobs, match, out);
      continue;
    }
    if (patch.area_px == 0) continue;
    // A single large or full one stays what its blob says.
    const auto n = static_cast<std::size_t>(patch.members[0]);
    if (patch.members.size() > 1) return std::nullopt;
    const Blob& blob = blobs[static_cast<std::size_t>(match.blob[n])];
    if (patch.area_px <= config_.area_max_px && !blob.saturated) return std::nullopt;
    if (misshapen(patch)) return std::nullopt;
    if (runs_on(blob, blur_px[n])) return std::nullopt;
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << n);
    o.uv = blob.uv;
    o.cov = blob.cov + displacement(static_cast<int>(n), blob);
    o.depth_m = blob.depth_m;
    out.seen.push_back(o);
  }
  std::uint16_t lit = 0;
  for (const LedObservation& o : out.seen)
    lit = static_cast<std::uint16_t>(lit | o.leds);
  if (out.seen.size() < 4 || (lit_ & ~lit) != 0) return std::nullopt;
  const double around = images.size_px + kStrangerReach;
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    if (is_used(match, static_cast<int>(j))) continue;
    // It may be the LED that is missing.
    const double d = (blobs[j].uv - images.middle).norm();
    if (out.seen.size() < static_cast<std::size_t>(leds_.size()) && d < around &&
        !blobs[j].stray) {
      return std::nullopt;
    }
    out.refused.push_back(unmatched(blobs[j]));
  }
  remember_lit(lit);
  learn_from(look, patches);
  return out;
}

bool LedResolver::misshapen(const Patch& patch) const {
  const auto led = static_cast<std::size_t>(patch.members[0]);
  return !patch.fit && patch.unlike && heights_[led] > 0;
}

bool LedResolver::is_its_own(const Blob& blob, int led, const Vector2& blur_px) const {
  const double height = heights_[static_cast<std::size_t>(led)];
  const bool may_be_white = height == 0 || height > kFull;
  if (config_.use_color && !colors_agree(blob.color, leds_.color(led), may_be_white)) {
    return false;
  }
  const double widest = 2 * spot_reach_px(spread_, blur_px) + 2;
  return !blob.cut && !blob.stray && blob.area_px <= config_.area_max_px &&
         blob.box.u1 - blob.box.u0 <= widest && blob.box.v1 - blob.box.v0 <= widest;
}

LedFrame LedResolver::hold(const ImageView& image, BlobSpan blobs,
                           const Pose& X_NB_predicted, const Matrix6& cov,
                           double slack_px, std::span<const Vector2> blur_px, Time t) {
  LedFrame out;
  out.t = t;
  const LedImages images = led_images(camera_, leds_, X_NB_predicted);
  if (images.count < leds_.size()) return out;
  const auto count = static_cast<std::size_t>(leds_.size());
  std::array<double, kMaxLeds> variance{};  // of the expected images, px^2
  for (std::size_t i = 0; i < count; ++i) {
    Matrix26 J;
    project_led(camera_, X_NB_predicted, leds_.p_BL(static_cast<int>(i)), &J);
    const Matrix2 S = J * cov * J.transpose();
    variance[i] = S.trace();
    if (!(variance[i] <= 2 * kHoldSd * kHoldSd)) return out;
  }

  // An LED's own blob stands where it is expected, or half way to a neighbour with
  // which it runs together.
  const double touch = config_.touch * spot_reach_px(spread_, Vector2::Zero());
  Assignment match;
  std::uint16_t beside_lamp = 0;
  for (std::size_t i = 0; i < count; ++i) {
    double aside = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const double d = (images.uv[k] - images.uv[i]).norm();
      if (k != i && d < touch) aside = std::max(aside, d / 2);
    }
    double reach = kHoldGate * std::sqrt(variance[i]) + kHoldSlack + slack_px + aside;
    for (std::size_t j = 0; j < blobs.size(); ++j) {
      const double d = (blobs[j].uv - images.uv[i]).norm();
      if (d >= reach) continue;
      if (is_its_own(blobs[j], static_cast<int>(i), blur_px[i])) {
        reach = d;
        match.blob[i] = static_cast<int>(j);
      } else if (blobs[j].area_px > config_.area_max_px && !blobs[j].stray &&
                 (heights_[i] == 0 || heights_[i] > kFull)) {
        return out;  // near the lens LEDs are as large as lamps
      }
    }
    if (match.blob[i] >= 0) continue;
    for (const Blob& blob : blobs) {
      const Vector2& uv = images.uv[i];
      if (uv.x() > blob.box.u0 - touch && uv.x() < blob.box.u1 + touch &&
          uv.y() > blob.box.v0 - touch && uv.y() < blob.box.v1 + touch) {
        beside_lamp = static_cast<std::uint16_t>(beside_lamp | (1u << i));
      }
    }
  }

  std::uint16_t lit = 0;
  Look look = look_at(image, blobs, match, images, blur_px, kHoldMargin);
  Patches patches = this->patches(images, blobs, match, nullptr);
  fit_all(look, patches, [](const Patch&) { return true; });
  compare_lights(look, patches, X_NB_predicted);
  for (const Patch& patch : patches) {
    if (!patch.fit || patch.fit->chi2_per_pixel > kHoldChi2 * std::max(noise_, 1.0)) {
      continue;
    }
    LedFrame seen;
    add(patch, blobs, match, seen);
    bool sure = !seen.seen.empty();
    for (const LedObservation& o : seen.seen) {
      const auto i = static_cast<std::size_t>(std::countr_zero(o.leds));
      const double most =
          kHoldGate * std::sqrt(variance[i] + o.cov.trace()) + kHoldSlack + slack_px;
      sure = sure && (o.uv - images.uv[i]).norm() < most &&
             o.cov.trace() < 2 * kHoldPlaceSd * kHoldPlaceSd;
      const auto member =
          std::find(patch.members.begin(), patch.members.end(), static_cast<int>(i)) -
          patch.members.begin();
      const double usual = heights_[i];
      const double now = patch.fit->height[static_cast<std::size_t>(member)];
      // Without a blob only a light that is known.
      sure = sure && (usual > 0 ? now < kHoldHeight * usual && usual < kHoldHeight * now
                                : match.blob[i] >= 0);
    }
    if (!sure) continue;
    for (OverlappingLeds group : seen.groups) {
      group.first += static_cast<int>(out.seen.size());
      out.groups.push_back(group);
    }
    for (const LedObservation& o : seen.seen) {
      out.seen.push_back(o);
      lit = static_cast<std::uint16_t>(lit | o.leds);
    }
  }
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    if (!is_used(match, static_cast<int>(j))) {
      out.refused.push_back(unmatched(blobs[j]));
    }
  }
  // What a lamp covers shines on.
  lit_ = static_cast<std::uint16_t>(lit | (lit_ & beside_lamp));
  return out;
}

}  // namespace alight
