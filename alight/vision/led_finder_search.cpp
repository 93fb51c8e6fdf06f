#include "alight/vision/led_finder_search.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace alight {
namespace {

/// Three points on the image to a first pose: how far its other LEDs may be off, as a
/// share of the constellation's size in px.
constexpr double kRoughShare = 0.12;
constexpr double kFineShare = 0.05;
/// Stretch, in its sd, from which a blob may be two LEDs that stand out from one.
constexpr double kLong = 2;
// Cost of the steps of a search, in units of LedFinderConfig::work_max.
constexpr int kLookUp = 1, kThreePoints = 60, kMatch = 100, kFit = 500;

}  // namespace

void LedFinder::Search::split_long(BlobSpan blobs) {
  split.assign(blobs.begin(), blobs.end());
  whole_blobs = static_cast<int>(blobs.size());
  for (const Blob& blob : blobs) {
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
    }
  }
}

void LedFinder::Search::prepare(BlobSpan blobs, bool white_is_any) {
  usable.clear();
  pinhole.clear();
  kept.clear();
  rough.clear();
  rough_next = 0;
  work = 0;
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
      usable.push_back(static_cast<int>(j));
      break;
    }
  }
  light_density = (static_cast<double>(usable.size()) + 1) /
                  (static_cast<double>(lens.width) * lens.height);
  for (std::size_t n = 0; n < usable.size(); ++n) {
    const Vector2 uv = blobs[static_cast<std::size_t>(usable[n])].uv;
    by_distance.clear();
    for (const int m : usable) {
      if (m == usable[n]) continue;
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

void LedFinder::Search::search_triples(BlobSpan blobs, bool white_is_any) {
  const auto blob = [&](int j) -> const Blob& {
    return blobs[static_cast<std::size_t>(j)];
  };
  const auto px = [&](int j) { return pinhole[static_cast<std::size_t>(j)]; };
  const auto fits = [&](std::size_t corner, int j) -> const TripleSet& {
    return of_color[corner][static_cast<std::size_t>(blob(j).color)];
  };
  std::array<int, kNeighbours + 1> near, whole_near;
  for (std::size_t n = 0; n < usable.size(); ++n) {
    const int i = usable[n];
    near[0] = i;
    std::copy(neighbours[n].begin(), neighbours[n].end(), near.begin() + 1);
    const std::span<const int> around(near.data(), neighbours[n].size() + 1);
    const auto whole_end =
        std::copy_if(around.begin(), around.end(), whole_near.begin(),
                     [&](int j) { return j < whole_blobs; });
    const std::span<const int> whole(whole_near.begin(), whole_end);
    for (const int j : neighbours[n]) {
      const ShapeTable::Side side = ShapeTable::side(px(i), px(j));
      for (const int k : neighbours[n]) {
        if (k == j) continue;
        work += kLookUp;
        const std::uint64_t* possible = shapes.possible(side, px(k));
        for (std::size_t w = 0; w < shapes.words(); ++w) {
          std::uint64_t left =
              possible[w] & fits(0, i)[w] & fits(1, j)[w] & fits(2, k)[w];
          for (; left != 0; left &= left - 1) {
            if (work > config.work_max) return;
            const auto t = w * 64 + static_cast<std::size_t>(std::countr_zero(left));
            const auto [a, b, c] = shapes.triples()[t];
            const Vector3 p_BL[3] = {leds.p_BL(a), leds.p_BL(b), leds.p_BL(c)};
            const Vector2 uv[3] = {blob(i).uv, blob(j).uv, blob(k).uv};
            work += kThreePoints;
            const ThreePointPoses start =
                three_point_poses(camera.intrinsics, p_BL, uv);
            for (int s = 0; s < start.count; ++s) {
              const Pose X_NB = camera.X_NC * start.X_CB[s];
              if (plausible(X_NB)) try_pose(blobs, X_NB, around, whole, white_is_any);
            }
          }
        }
      }
    }
  }
}

void LedFinder::Search::try_pose(BlobSpan blobs, const Pose& X_NB,
                                 std::span<const int> near, std::span<const int> whole,
                                 bool white_is_any) {
  // A cheap count first: most poses explain their own three points and nothing else.
  const Pose X_CB = camera.X_NC.inverse() * X_NB;
  const Intrinsics& lens = camera.intrinsics;
  const double range = (X_CB * centre_B).norm();
  const double reach = 2 + kRoughShare * lens.fx * radius_m / range;
  int explained = 0;
  for (int l = 0; l < leds.size(); ++l) {
    const Vector3 p_CL = X_CB * leds.p_BL(l);
    if (p_CL.z() < 0.02) return;
    const Vector2 uv(lens.fx * p_CL.x() / p_CL.z() + lens.cx,
                     lens.fy * p_CL.y() / p_CL.z() + lens.cy);
    for (const int j : near) {
      const auto m = static_cast<std::size_t>(j);
      if ((pinhole[m] - uv).squaredNorm() < reach * reach &&
          (!config.use_color ||
           colors_agree(blobs[m].color, leds.color(l), white_is_any))) {
        ++explained;
        break;
      }
    }
  }
  if (explained < 4) return;

  work += kMatch;
  Candidate candidate;
  candidate.X_NB = X_NB;
  LedImages images = led_images(camera, leds, X_NB);
  GroupRule rule{reach, 1, 5, config.merge_px, config.use_color, white_is_any};
  candidate.assignment = match_groups(images, leds, blobs, whole, rule, scratch);
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
  candidate.assignment = match_groups(images, leds, blobs, whole, rule, scratch);
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
