#include "alight/vision/led_finder_search.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "alight/vision/wide.h"

namespace alight {
namespace {

/// Three points to a first pose: how far its other LEDs may be off, as a share of the
/// constellation's size, and more the larger it stands in view, until so many steps
/// have taken that away. LEDs that are off move the others by so many of their sd.
constexpr double kRoughShare = 0.06, kPerspective = 0.6;
constexpr int kPerspectiveSteps = 2;
constexpr double kLedSds = 4;
constexpr double kSameUp = 0.95;  // cosine: two guesses at the same pose
/// LEDs explained less than by the best guess, and than by one that misses none where
/// none can be an image in the pad.
constexpr double kGuessMargin = 2, kMarginOfAll = 1;
constexpr double kFineShare = 0.05;
/// Stretch, in its sd, from which a blob may be two LEDs that stand out from one.
constexpr double kLong = 2;
/// Words of the largest set of triples.
constexpr std::size_t kWordsMost =
    (kMaxLeds * (kMaxLeds - 1) * (kMaxLeds - 2) / 6 + 63) / 64;
/// Of so many LEDs all but one, or as good, explained by a guess are no chance where
/// they stand before lights of their own, but for this share of them.
constexpr int kMany = 9;
constexpr double kNearlyAll = 1;
constexpr double kOfTheirOwn = 0.75;
constexpr double kWider = 1.15;  // than what it explains is what is looked at then
constexpr double kUsualLeds = 6;
// Cost of the steps of a search, in units of LedFinderConfig::work_max.
constexpr int kLookUp = 1, kThreePoints = 4, kMatch = 100, kFit = 500;

}  // namespace

void LedFinder::Search::split_long(BlobSpan blobs) {
  split.assign(blobs.begin(), blobs.end());
  whole_blobs = split.size();
  whole.resize(whole_blobs);
  std::iota(whole.begin(), whole.end(), 0);
  for (std::size_t j = 0; j < whole_blobs; ++j) {
    const Blob& blob = blobs[j];
    const Vector2 stretch = stretch_of(blob.spread);
    const double length = stretch.norm();
    if (blob.area_px > 100 || length < kLong * stretch_sd(blob, 0, 0)) continue;
    if (split.size() + 2 > 2 * kMaxBlobs) break;
    // Two equal lights lie one standard deviation of what they add to either side.
    const double way = std::atan2(stretch.y(), stretch.x()) / 2;
    const Vector2 along(std::cos(way), std::sin(way));
    for (const double sign : {1.0, -1.0}) {
      Blob part = blob;
      part.uv += sign * std::sqrt(length) * along;
      part.cov += 0.1 * Matrix2::Identity();
      part.spread -= length * along * along.transpose();
      split.push_back(part);
      whole.push_back(static_cast<int>(j));
    }
  }
}

void LedFinder::Search::prepare(BlobSpan blobs, bool white_is_any) {
  usable.clear();
  seeds.clear();
  pinhole.clear();
  kept.clear();
  rough.clear();
  rough_next = 0;
  const Intrinsics& lens = camera.intrinsics;
  const auto agrees = [&](LedColor seen, int led) {
    return !config.use_color || colors_agree(seen, leds.color(led), white_is_any);
  };
  for (std::size_t corner = 0; corner < 3; ++corner) {
    for (std::size_t color = 0; color < 5; ++color) {
      TripleSet& set = of_color[corner][color];
      std::fill(set.begin(), set.end(), 0);
      for (std::size_t t = 0; t < shapes.triples().size(); ++t) {
        if (agrees(static_cast<LedColor>(color), shapes.triples()[t][corner])) {
          set[t / 64] |= std::uint64_t{1} << (t % 64);
        }
      }
    }
  }
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    const Vector3 ray = lens.unproject(blobs[j].uv);
    pinhole.emplace_back(lens.fx * ray.x() + lens.cx, lens.fy * ray.y() + lens.cy);
    for (int i = 0; i < leds.size() && !blobs[j].cut; ++i) {
      if (!agrees(blobs[j].color, i)) continue;
      seeds.push_back(static_cast<int>(j));
      // The parts only serve the search.
      if (j < whole_blobs) usable.push_back(static_cast<int>(j));
      break;
    }
  }
  find_twins(blobs);
  light_density = (static_cast<double>(usable.size()) + 1) /
                  (static_cast<double>(lens.width) * lens.height);
  for (std::size_t n = 0; n < seeds.size(); ++n) {
    const Vector2 uv = blobs[static_cast<std::size_t>(seeds[n])].uv;
    by_distance.clear();
    for (const int m : seeds) {
      if (m == seeds[n]) continue;
      by_distance.emplace_back(
          (blobs[static_cast<std::size_t>(m)].uv - uv).squaredNorm(), m);
    }
    const std::size_t count = std::min<std::size_t>(by_distance.size(), kNeighbours);
    std::partial_sort(by_distance.begin(),
                      by_distance.begin() + static_cast<std::ptrdiff_t>(count),
                      by_distance.end());
    neighbours[n].clear();
    for (std::size_t k = 0; k < count; ++k) {
      neighbours[n].push_back(by_distance[k].second);
    }
  }
}

void LedFinder::Search::prepare_corners() {
  corners.clear();
  for (const ShapeTable::Triple& triple : shapes.triples()) {
    const Vector3& first = leds.p_BL(triple[0]);
    const Vector3 a = leds.p_BL(triple[1]) - first, b = leds.p_BL(triple[2]) - first;
    Corners c;
    c.aa = a.squaredNorm();
    c.bb = b.squaredNorm();
    c.ab = a.dot(b);
    c.det = c.aa * c.bb - c.ab * c.ab;
    Matrix3 sides;
    sides << a, b, a.cross(b);
    const Matrix3 into = sides.inverse();
    c.up = into.col(2);
    for (int l = 0; l < leds.size(); ++l) {
      c.place[static_cast<std::size_t>(l)] = into * (leds.p_BL(l) - first);
    }
    std::size_t others = 0, own = static_cast<std::size_t>(leds.size()) - 3;
    for (int l = 0; l < leds.size(); ++l) {
      const bool is_own = std::find(triple.begin(), triple.end(), l) != triple.end();
      c.order[is_own ? own++ : others++] = static_cast<std::uint8_t>(l);
    }
    corners.push_back(c);
  }
}

void LedFinder::Search::look_around(BlobSpan blobs, std::size_t n, bool white_is_any) {
  const int seed = seeds[n];
  around.blob[0] = seed;
  std::copy(neighbours[n].begin(), neighbours[n].end(), around.blob.begin() + 1);
  around.count = neighbours[n].size() + 1;
  const Intrinsics& lens = camera.intrinsics;
  const auto ray = [&](int j) {
    const Vector2& uv = pinhole[static_cast<std::size_t>(j)];
    return Vector3((uv.x() - lens.cx) / lens.fx, (uv.y() - lens.cy) / lens.fy, 1);
  };
  const Vector3 z = ray(seed).normalized();
  const Vector3 x = Vector3::UnitY().cross(z).normalized();
  around.R_CV << x, z.cross(x), z;
  around.up_V = around.R_CV.transpose() * camera.X_NC.linear().row(2).transpose();
  around.x.fill(1e6f);
  around.y.fill(1e6f);
  for (auto& row : around.wrong) row.fill(0);
  for (std::size_t m = 0; m < around.count; ++m) {
    const Vector3 p = around.R_CV.transpose() * ray(around.blob[m]);
    // What lies far to the side is another light.
    const double w = std::max(p.z(), 1e-3);
    around.x[m] = static_cast<float>(p.x() / w);
    around.y[m] = static_cast<float>(p.y() / w);
    const LedColor seen = blobs[static_cast<std::size_t>(around.blob[m])].color;
    for (std::size_t color = 0; color < 5; ++color) {
      const bool agree = !config.use_color ||
                         colors_agree(seen, static_cast<LedColor>(color), white_is_any);
      around.wrong[color][m] = agree ? 0.0f : 1e6f;
    }
    const int light = whole[static_cast<std::size_t>(around.blob[m])];
    std::size_t first = 0;
    while (whole[static_cast<std::size_t>(around.blob[first])] != light) ++first;
    around.light[m] = std::uint32_t{1} << first;
  }
}

ALIGHT_INLINE std::pair<std::size_t, double> LedFinder::Search::Around::nearest(
    float at_x, float at_y, std::size_t color) const {
  // Positive floats compare like their bits; the last bits carry which it was.
  static_assert(kRoom <= 32);
  const Row& far = wrong[color];
  std::int32_t best = std::numeric_limits<std::int32_t>::max();
  for (std::size_t m = 0; m < kRoom; ++m) {
    const float dx = x[m] - at_x, dy = y[m] - at_y;
    const auto bits = std::bit_cast<std::int32_t>(dx * dx + dy * dy + far[m]);
    best = std::min(best, (bits & ~31) | static_cast<std::int32_t>(m));
  }
  return {static_cast<std::size_t>(best & 31),
          static_cast<double>(std::bit_cast<float>(best & ~31))};
}

void LedFinder::Search::search_triples(BlobSpan blobs, bool white_is_any,
                                       std::size_t first, std::size_t last) {
  shapes.words() == 1 ? search_triples_in<1>(blobs, white_is_any, first, last)
                      : search_triples_in<0>(blobs, white_is_any, first, last);
}

template <std::size_t kWords>
void LedFinder::Search::search_triples_in(BlobSpan blobs, bool white_is_any,
                                          std::size_t first, std::size_t last) {
  guesses.clear();
  guess_worst = 0;
  narrowed_radius_px = 0;
  const std::int64_t most = work_most();
  const auto px = [&](int j) { return pinhole[static_cast<std::size_t>(j)]; };
  const auto fits = [&](std::size_t corner, int j) -> const TripleSet& {
    return of_color[corner]
                   [static_cast<std::size_t>(blobs[static_cast<std::size_t>(j)].color)];
  };
  // What of each word of a set is asked for now.
  const std::size_t words = kWords > 0 ? kWords : shapes.words();
  constexpr std::size_t kRoom = kWords > 0 ? kWords : kWordsMost;
  std::array<std::uint64_t, kRoom> asked{}, by_one{}, by_two{};
  for (std::size_t t = first; t < last; ++t)
    asked[t / 64] |= std::uint64_t{1} << t % 64;
  // If the work runs out, it does so all over the picture.
  const std::size_t count = seeds.size();
  std::size_t stride = std::max<std::size_t>(1, count * 5 / 8);
  while (std::gcd(stride, count) != 1) ++stride;
  // And where one stands still the next picture's goes on from there.
  std::size_t& next = next_seed[white_is_any ? 1 : 0];
  const std::size_t begin = next;
  for (std::size_t step = 0; step < count; ++step) {
    const std::size_t n = (begin + step) * stride % count;
    if (!looked_at(seeds[n])) continue;
    next = begin + step;
    look_around(blobs, n, white_is_any);
    const int i = around.blob[0];
    std::uint64_t any = 0;
    for (std::size_t w = 0; w < words; ++w) any |= by_one[w] = asked[w] & fits(0, i)[w];
    if (any == 0) continue;
    for (std::size_t j = 1; j < around.count; ++j) {
      if (!looked_at(around.blob[j])) continue;
      const TripleSet& second = fits(1, around.blob[j]);
      any = 0;
      for (std::size_t w = 0; w < words; ++w) any |= by_two[w] = by_one[w] & second[w];
      if (any == 0) continue;
      const ShapeTable::Side side = ShapeTable::side(px(i), px(around.blob[j]));
      for (std::size_t k = 1; k < around.count; ++k) {
        if (k == j || !looked_at(around.blob[k])) continue;
        work += kLookUp;
        const std::uint64_t* possible = shapes.possible(side, px(around.blob[k]));
        const TripleSet& third = fits(2, around.blob[k]);
        for (std::size_t w = 0; w < words; ++w) {
          std::uint64_t left = possible[w] & by_two[w] & third[w];
          for (; left != 0; left &= left - 1) {
            if (work > most) return;
            guess(w * 64 + static_cast<std::size_t>(std::countr_zero(left)), j, k);
          }
        }
      }
    }
  }
  next = 0;
}

namespace {

/// Three LEDs as scaled orthographic projection has them: the images of the second and
/// third, seen from the first along the ray to it, and how deep they then lie behind
/// it, all in units of its distance.
struct ThreeSeen {
  double ex, ey, fx, fy;  // tangents
  double s = 0, h = 0, d = 0;
  double normal_x = 0, normal_y = 0, normal_z = 0;

  template <class Sides>
  bool solve(const Sides& c) {
    const double ee = ex * ex + ey * ey, ff = fx * fx + fy * fy, ef = ex * fx + ey * fy;
    const double B = c.aa * ff + c.bb * ee - 2 * c.ab * ef;
    const double C = ee * ff - ef * ef;
    const double s2 =
        (B + std::sqrt(std::max(B * B - 4 * c.det * C, 0.0))) / (2 * c.det);
    if (!(s2 > 0)) return false;
    s = std::sqrt(s2);
    h = std::sqrt(std::max(s2 * c.aa - ee, 0.0));
    d = std::sqrt(std::max(s2 * c.bb - ff, 0.0));
    if (s2 * c.ab - ef < 0) d = -d;
    return true;
  }
  void find_normal() {
    normal_x = (ey * d - h * fy) / s;
    normal_y = (h * fx - ex * d) / s;
    normal_z = (ex * fy - ey * fx) / s;
  }
  Vector3 place(const Vector3& at, double sign) const {
    return {at.x() * ex + at.y() * fx + at.z() * sign * normal_x,
            at.x() * ey + at.y() * fy + at.z() * sign * normal_y,
            sign * (at.x() * h + at.y() * d) + at.z() * normal_z};
  }
};

}  // namespace

ALIGHT_INLINE void LedFinder::Search::guess_by(std::size_t triple, std::size_t j,
                                               std::size_t k) {
  work += kThreePoints;
  // As in three_point_poses, about the ray to the first of the three.
  const Corners& c = corners[triple];
  ThreeSeen three{around.x[j], around.y[j], around.x[k], around.y[k]};
  if (!three.solve(c)) return;
  // 1.4 and 0.7: what the projection makes of a near drone's range.
  if (!(three.s * config.range_max_m > 0.7 && three.s * config.range_min_m < 1.4)) {
    return;
  }
  three.find_normal();
  const auto n = static_cast<std::size_t>(leds.size());
  const double worst = guesses.full() ? guess_worst : static_cast<double>(n) - 3.5;
  const auto weigh = [&](const ThreeSeen& seen, double sign, bool exact, Guess& out)
      __attribute__((always_inline)) {
    const Vector3 up_V = seen.place(c.up, sign) / seen.s;
    const double up = up_V.dot(around.up_V);
    if (up < cos_tilt_most) return false;
    const double size = seen.s * radius_m;
    const double skewed = kPerspective * size * size;
    const double off =
        exact ? std::min(kLedSds * config.led_sd_m * seen.s, skewed) : skewed;
    const double reach = 2 / camera.intrinsics.fx + size * kRoughShare + off;
    const double reach2 = reach * reach;
    out.cost = 0.1 * (1 - up);
    out.up_C = around.R_CV * up_V;
    std::uint32_t lights = 0;
    for (std::size_t o = 0; o < n; ++o) {
      const std::size_t l = c.order[o];
      Vector3 at = seen.place(c.place[l], sign);
      if (exact) at /= std::max(1 + at.z(), 0.1);
      const auto [m, d2] =
          around.nearest(static_cast<float>(at.x()), static_cast<float>(at.y()),
                         static_cast<std::size_t>(leds.leds[l].color));
      const bool explained = d2 < reach2;
      out.cost += explained ? d2 / reach2 : 1.0;
      out.blob[l] = static_cast<std::int16_t>(explained ? around.blob[m] : -1);
      if (explained) lights |= around.light[m];
      ++work;
      if (out.cost >= worst) return false;
    }
    out.lights = std::popcount(lights);
    return out.lights >= 4;
  };
  for (const double sign : {1.0, -1.0}) {
    Guess out;
    if (!weigh(three, sign, false, out)) continue;
    // What is near stands wide apart in view, and most lights are near to where rough
    // places of LEDs then are: as far as these are off by perspective, it is known how.
    work += kPerspectiveSteps * kThreePoints;
    ThreeSeen exact = three;
    for (int step = 0; step < kPerspectiveSteps; ++step) {
      const double behind_j = 1 + sign * exact.h, behind_k = 1 + sign * exact.d;
      exact.ex = three.ex * behind_j;
      exact.ey = three.ey * behind_j;
      exact.fx = three.fx * behind_k;
      exact.fy = three.fy * behind_k;
      if (!(behind_j > 0 && behind_k > 0) || !exact.solve(c)) break;
    }
    exact.find_normal();
    if (!weigh(exact, sign, true, out)) continue;
    out.triple = static_cast<int>(triple);
    out.corner = {around.blob[0], around.blob[j], around.blob[k]};
    out.flipped = sign < 0;
    keep_guess(out);
  }
}

void LedFinder::Search::guess(std::size_t triple, std::size_t j, std::size_t k) {
#if defined(ALIGHT_WIDE)
  if (is_wide()) return guess_wide(triple, j, k);
#endif
  guess_by(triple, j, k);
}

#if defined(ALIGHT_WIDE)
ALIGHT_WIDE void LedFinder::Search::guess_wide(std::size_t triple, std::size_t j,
                                               std::size_t k) {
  guess_by(triple, j, k);
}
#endif

void LedFinder::Search::keep_guess(const Guess& guess) {
  narrow(guess);
  std::size_t worst = 0;
  for (std::size_t g = 0; g < guesses.size(); ++g) {
    Guess& other = guesses[g];
    if (other.blob == guess.blob && other.up_C.dot(guess.up_C) > kSameUp) {
      if (guess.cost < other.cost) other = guess;
      return;
    }
    if (other.cost > guesses[worst].cost) worst = g;
  }
  if (guesses.push_back(guess)) {
    if (!guesses.full()) return;
  } else {
    guesses[worst] = guess;
  }
  guess_worst = 0;
  for (const Guess& other : guesses) guess_worst = std::max(guess_worst, other.cost);
}

void LedFinder::Search::narrow(const Guess& guess) {
  if (leds.size() < kMany || guess.cost > kNearlyAll ||
      guess.lights < kOfTheirOwn * leds.size() || narrowed_radius_px > 0) {
    return;
  }
  Vector2 low = Vector2::Constant(1e9), high = -low;
  for (std::size_t l = 0; l < static_cast<std::size_t>(leds.size()); ++l) {
    if (guess.blob[l] < 0) continue;
    const Vector2& uv = pinhole[static_cast<std::size_t>(guess.blob[l])];
    low = low.cwiseMin(uv);
    high = high.cwiseMax(uv);
  }
  narrowed_px = (low + high) / 2;
  narrowed_radius_px = kWider * (high - low).norm() / 2;
}

bool LedFinder::Search::looked_at(int blob) const {
  const Vector2& uv = pinhole[static_cast<std::size_t>(blob)];
  return narrowed_radius_px <= 0 ||
         (uv - narrowed_px).squaredNorm() < narrowed_radius_px * narrowed_radius_px;
}

std::int64_t LedFinder::Search::work_most() const {
  const double more = std::max(1.0, leds.size() / kUsualLeds);
  return static_cast<std::int64_t>(more * config.work_max);
}

void LedFinder::Search::try_guesses(BlobSpan blobs, bool white_is_any) {
  std::sort(guesses.begin(), guesses.end(), [](const Guess& a, const Guess& b) {
    return a.cost != b.cost ? a.cost < b.cost : a.blob < b.blob;
  });
  if (guesses.empty()) return;
  const double least = guesses.front().cost;
  const bool all = least < kMarginOfAll && twins.empty();
  const double margin = all ? kMarginOfAll : kGuessMargin;
  for (const Guess& guess : guesses) {
    if (guess.cost > least + margin) break;
    const ShapeTable::Triple& t =
        shapes.triples()[static_cast<std::size_t>(guess.triple)];
    Vector3 p_BL[3];
    Vector2 uv[3];
    for (std::size_t n = 0; n < 3; ++n) {
      p_BL[n] = leds.p_BL(t[n]);
      uv[n] = blobs[static_cast<std::size_t>(guess.corner[n])].uv;
    }
    const ThreePointPoses start = three_point_poses(camera.intrinsics, p_BL, uv);
    for (int n = 0; n < start.count; ++n) {
      const Pose X_NB = camera.X_NC * start.X_CB[n];
      const Vector3 up_C = start.X_CB[n].linear().col(2);
      if (up_C.dot(guess.up_C) < 0.85 || !plausible(X_NB)) continue;
      try_pose(blobs, X_NB, white_is_any);
    }
  }
}

void LedFinder::Search::try_pose(BlobSpan blobs, const Pose& X_NB, bool white_is_any) {
  work += kMatch;
  Candidate candidate;
  candidate.X_NB = X_NB;
  LedImages images = led_images(camera, leds, X_NB);
  GroupRule rule{2 + 0.12 * images.size_px, 1,           5, config.merge_px,
                 config.use_color,          white_is_any};
  candidate.assignment = match_groups(images, leds, blobs, usable, rule, scratch);
  if (candidate.assignment.blobs < 4) return;
  for (const Candidate& other : rough) {
    if (other.assignment == candidate.assignment && !rivals(other.X_NB, X_NB)) return;
  }
  if (!rough.push_back(candidate)) rough[rough_next++ % kTried] = candidate;

  work += kFit;
  const auto terms = blob_terms(candidate.assignment, images, blobs, 0.5);
  const auto fit =
      fit_blobs(camera, leds, {terms.data(), terms.size()}, 4 * tilt_sd(), X_NB, 3);
  if (!fit || !plausible(fit->X_NB)) return;
  images = led_images(camera, leds, fit->X_NB);
  rule.tolerance_px = 2 + kFineShare * images.size_px;
  candidate.X_NB = fit->X_NB;
  candidate.assignment = match_groups(images, leds, blobs, usable, rule, scratch);
  if (candidate.assignment.blobs < 4) return;
  // With what is left over as the missing LEDs' residual.
  double square = 0;
  for (std::size_t l = 0; l < static_cast<std::size_t>(leds.size()); ++l) {
    const int j = candidate.assignment.blob[l];
    square +=
        j < 0 ? rule.tolerance_px * rule.tolerance_px
              : (blobs[static_cast<std::size_t>(j)].uv - images.uv[l]).squaredNorm();
  }
  candidate.score = square / (rule.tolerance_px * rule.tolerance_px);
  keep(candidate);
}

void LedFinder::Search::keep(const Candidate& candidate) {
  for (Candidate& other : kept) {
    if (!(other.assignment == candidate.assignment) ||
        rivals(other.X_NB, candidate.X_NB)) {
      continue;
    }
    if (candidate.score < other.score) other = candidate;
    return;
  }
  if (kept.push_back(candidate)) return;
  auto* worst = std::max_element(
      kept.begin(), kept.end(),
      [](const Candidate& a, const Candidate& b) { return a.score < b.score; });
  if (candidate.score < worst->score) *worst = candidate;
}

}  // namespace alight
