#include "alight/vision/led_finder.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "alight/vision/led_finder_search.h"

namespace alight {
namespace {

/// Three points on the image to a first pose: how far its other LEDs may be off, as a
/// share of the constellation's size in px.
constexpr double kRoughShare = 0.12;
constexpr double kFineShare = 0.05;

double angle_of_cosine(double c) { return std::acos(std::clamp(c, -1.0, 1.0)); }

Vector3 middle_of(const Constellation& leds) {
  Vector3 sum = Vector3::Zero();
  for (const Led& led : leds.leds) sum += led.p_BL / leds.size();
  return sum;
}

double radius_of(const Constellation& leds) {
  double radius = 0;
  for (const Led& led : leds.leds) {
    radius = std::max(radius, (led.p_BL - middle_of(leds)).norm());
  }
  return radius;
}

/// A blob this much longer than the roundest, by second moments, may be two LEDs.
constexpr double kLong = 2.2;

/// Larger over smaller second moment.
double stretch_of(const Blob& blob) {
  const Matrix2 S = blob.spread + 0.1 * Matrix2::Identity();
  const double half = S.trace() / 2;
  const double gap = std::sqrt(std::max(half * half - S.determinant(), 0.0));
  return (half + gap) / std::max(half - gap, 1e-3);
}

/// log of n over k.
double log_choose(int n, int k) {
  return std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1);
}

/// Rivals are poses that a filter started on one would not turn into the other.
bool rivals(const Pose& a, const Pose& b) {
  return angle_between(a.linear(), b.linear()) > 12 * kDegree ||
         (a.translation() - b.translation()).norm() > 0.15;
}

}  // namespace

Result<void> LedFinderConfig::validate() const {
  const auto out = [](const char* name, double value, const char* bounds) {
    std::ostringstream text;
    text << "finder." << name << " is " << value << ", must lie in " << bounds;
    return fail(Fault::invalid_config, text.str());
  };
  if (!(range_min_m >= 0.05 && range_min_m <= 100)) {
    return out("range_min_m", range_min_m, "[0.05, 100]");
  }
  if (!(range_max_m > range_min_m && range_max_m <= 1000)) {
    return out("range_max_m", range_max_m, "(range_min_m, 1000]");
  }
  if (!(tilt_max_deg >= 1 && tilt_max_deg <= 180)) {
    return out("tilt_max_deg", tilt_max_deg, "[1, 180]");
  }
  if (!(tilt_sd_deg > 0 && tilt_sd_deg <= 1e4)) {
    return out("tilt_sd_deg", tilt_sd_deg, "(0, 1e4]");
  }
  if (!(facing_max_deg >= 1 && facing_max_deg <= 180)) {
    return out("facing_max_deg", facing_max_deg, "[1, 180]");
  }
  if (!(rms_max_px > 0 && rms_max_px <= 50)) {
    return out("rms_max_px", rms_max_px, "(0, 50]");
  }
  if (!(led_sd_m >= 0 && led_sd_m <= 0.1)) return out("led_sd_m", led_sd_m, "[0, 0.1]");
  if (!(centroid_sd_px > 0 && centroid_sd_px <= 20)) {
    return out("centroid_sd_px", centroid_sd_px, "(0, 20]");
  }
  if (!(merge_px >= 0 && merge_px <= 50)) return out("merge_px", merge_px, "[0, 50]");
  if (!(missing_cost >= 0 && missing_cost <= 1e4)) {
    return out("missing_cost", missing_cost, "[0, 1e4]");
  }
  if (!(runner_up_margin >= 0 && runner_up_margin <= 1e4)) {
    return out("runner_up_margin", runner_up_margin, "[0, 1e4]");
  }
  if (!(false_alarms_max > 0 && false_alarms_max <= 1e6)) {
    return out("false_alarms_max", false_alarms_max, "(0, 1e6]");
  }
  if (hypotheses_max < 1) return out("hypotheses_max", hypotheses_max, "[1, 2^31)");
  if (!(mad_limit_m > 0 && mad_limit_m <= 10)) {
    return out("mad_limit_m", mad_limit_m, "(0, 10]");
  }
  return {};
}

LedFinder::LedFinder(std::unique_ptr<Search> search) : search_(std::move(search)) {}
LedFinder::LedFinder(LedFinder&&) noexcept = default;
LedFinder& LedFinder::operator=(LedFinder&&) noexcept = default;
LedFinder::~LedFinder() = default;

Result<LedFinder> LedFinder::create(const LedFinderConfig& config, const Camera& camera,
                                    const Constellation& leds) {
  if (const auto valid = config.validate(); !valid) return fail(valid.error());
  if (leds.size() < 4) {
    return fail(Fault::invalid_config, "a pose needs at least 4 LEDs, the rig has " +
                                           std::to_string(leds.size()));
  }
  auto search = std::make_unique<Search>(config, camera, leds);
  if (search->shapes.triples().empty()) {
    return fail(Fault::invalid_config,
                "the LEDs stand in a line, or no pose that is allowed is in view");
  }
  return LedFinder(std::move(search));
}

Result<FoundLeds> LedFinder::find(BlobSpan blobs, Time t) {
  return search_->config.profile == LedFinderConfig::Profile::paper
             ? search_->find_paper(blobs, t)
             : search_->find_standard(blobs, t);
}

LedFinder::Search::Search(const LedFinderConfig& config_in, const Camera& camera_in,
                          const Constellation& leds_in)
    : config(config_in),
      camera(camera_in),
      leds(leds_in),
      centre_B(middle_of(leds_in)),
      radius_m(radius_of(leds_in)),
      shapes(camera, leds, config.range_min_m, config.range_max_m,
             [this](const Pose& X_NB) { return plausible(X_NB); }),
      neighbours(2 * kMaxBlobs) {
  split.reserve(2 * kMaxBlobs);
  usable.reserve(2 * kMaxBlobs);
  by_distance.reserve(2 * kMaxBlobs);
  pinhole.reserve(2 * kMaxBlobs);
  for (auto& list : neighbours) list.reserve(kNeighbours);
}

bool LedFinder::Search::plausible(const Pose& X_NB) const {
  const Vector3 lens_from_drone = camera.X_NC.translation() - X_NB * centre_B;
  const double range = lens_from_drone.norm();
  if (!(range >= config.range_min_m && range <= config.range_max_m)) return false;
  if (X_NB.linear()(2, 2) < std::cos(config.tilt_max_deg * kDegree)) return false;
  if (config.facing_max_deg >= 180) return true;
  const Vector2 side =
      (X_NB.linear() * Vector3(centre_B.x(), centre_B.y(), 0)).head<2>();
  const double level = lens_from_drone.head<2>().norm();
  // LEDs around the middle face nowhere; from below or above the side does not matter.
  if (side.norm() < 0.25 * radius_m || level < 0.3 * range) return true;
  return angle_of_cosine(side.dot(lens_from_drone.head<2>()) / (side.norm() * level)) <
         config.facing_max_deg * kDegree;
}

void LedFinder::Search::prepare(BlobSpan blobs, bool white_is_any) {
  usable.clear();
  pinhole.clear();
  kept.clear();
  tried = 0;
  const Intrinsics& lens = camera.intrinsics;
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    const Vector3 ray = lens.unproject(blobs[j].uv);
    pinhole.emplace_back(lens.fx * ray.x() + lens.cx, lens.fy * ray.y() + lens.cy);
    const bool any =
        std::any_of(leds.leds.begin(), leds.leds.end(), [&](const Led& led) {
          return !config.use_color ||
                 colors_agree(blobs[j].color, led.color, white_is_any);
        });
    if (any) usable.push_back(static_cast<int>(j));
  }
  for (std::size_t n = 0; n < usable.size(); ++n) {
    const Vector2 uv = blobs[static_cast<std::size_t>(usable[n])].uv;
    by_distance.clear();
    for (std::size_t m = 0; m < usable.size(); ++m) {
      if (m == n) continue;
      const double d2 =
          (blobs[static_cast<std::size_t>(usable[m])].uv - uv).squaredNorm();
      by_distance.emplace_back(d2, usable[m]);
    }
    const std::size_t count = std::min<std::size_t>(by_distance.size(), kNeighbours);
    std::partial_sort(by_distance.begin(),
                      by_distance.begin() + static_cast<std::ptrdiff_t>(count),
                      by_distance.end());
    neighbours[n].clear();
    for (std::size_t k = 0; k < count; ++k)
      neighbours[n].push_back(by_distance[k].second);
  }
}

void LedFinder::Search::search_triples(BlobSpan blobs, bool white_is_any) {
  const auto agrees = [&](int blob, int led) {
    return !config.use_color ||
           colors_agree(blobs[static_cast<std::size_t>(blob)].color, leds.color(led),
                        white_is_any);
  };
  const auto px = [&](int blob) { return pinhole[static_cast<std::size_t>(blob)]; };
  for (std::size_t t = 0; t < shapes.triples().size(); ++t) {
    const auto [a, b, c] = shapes.triples()[t];
    const Vector3 p_BL[3] = {leds.p_BL(a), leds.p_BL(b), leds.p_BL(c)};
    for (std::size_t n = 0; n < usable.size(); ++n) {
      const int i = usable[n];
      if (!agrees(i, a)) continue;
      for (const int j : neighbours[n]) {
        if (!agrees(j, b)) continue;
        for (const int k : neighbours[n]) {
          if (k == j || !agrees(k, c) || !shapes.possible(t, px(i), px(j), px(k))) {
            continue;
          }
          if (++tried > config.hypotheses_max) return;
          const Vector2 uv[3] = {blobs[static_cast<std::size_t>(i)].uv,
                                 blobs[static_cast<std::size_t>(j)].uv,
                                 blobs[static_cast<std::size_t>(k)].uv};
          const ThreePointPoses start = three_point_poses(camera.intrinsics, p_BL, uv);
          for (int s = 0; s < start.count; ++s) {
            const Pose X_NB = camera.X_NC * start.X_CB[s];
            if (plausible(X_NB)) try_pose(blobs, X_NB, neighbours[n], white_is_any);
          }
        }
      }
    }
  }
}

void LedFinder::Search::try_pose(BlobSpan blobs, const Pose& X_NB,
                                 const std::vector<int>& near, bool white_is_any) {
  // A cheap count first: most poses explain their own three points and nothing else.
  const Pose X_CB = camera.X_NC.inverse() * X_NB;
  const Intrinsics& lens = camera.intrinsics;
  const double range = (X_CB * centre_B).norm();
  const double rough = 2 + kRoughShare * lens.fx * radius_m / range;
  int explained = 0;
  for (int l = 0; l < leds.size(); ++l) {
    const Vector3 p_CL = X_CB * leds.p_BL(l);
    if (p_CL.z() < 0.02) return;
    const Vector2 uv(lens.fx * p_CL.x() / p_CL.z() + lens.cx,
                     lens.fy * p_CL.y() / p_CL.z() + lens.cy);
    for (const int j : near) {
      if ((pinhole[static_cast<std::size_t>(j)] - uv).squaredNorm() < rough * rough) {
        ++explained;
        break;
      }
    }
  }
  if (explained < 3) return;

  Candidate candidate;
  candidate.X_NB = X_NB;
  LedImages images = led_images(camera, leds, X_NB);
  MatchRule rule{rough, config.merge_px, config.use_color, white_is_any};
  candidate.assignment = match_leds(images, leds, blobs, usable, rule);
  if (candidate.assignment.blobs < 4) return;
  for (const Candidate& other : kept) {
    if (other.assignment == candidate.assignment && !rivals(other.X_NB, X_NB)) return;
  }
  const auto seen = observations(candidate.assignment, images, blobs, 0.15);
  const auto fit =
      refine_pose(camera, leds, {seen.data(), seen.size()}, X_NB, nullptr, 3);
  if (!fit || !plausible(fit->X_NB)) return;
  images = led_images(camera, leds, fit->X_NB);
  rule.tolerance_px = 2 + kFineShare * images.size_px;
  candidate.X_NB = fit->X_NB;
  candidate.assignment = match_leds(images, leds, blobs, usable, rule);
  if (candidate.assignment.blobs < 4) return;
  // With what is left over as the missing LEDs' residual.
  double square = 0;
  for (int l = 0; l < leds.size(); ++l) {
    const auto n = static_cast<std::size_t>(l);
    const int j = candidate.assignment.blob[n];
    square +=
        j < 0 ? rule.tolerance_px * rule.tolerance_px
              : (blobs[static_cast<std::size_t>(j)].uv - images.uv[n]).squaredNorm();
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

double LedFinder::Search::sigma2(const Pose& X_NB) const {
  const double range = (X_NB * centre_B - camera.X_NC.translation()).norm();
  const double led_px = config.led_sd_m * camera.intrinsics.fx / range;
  return config.centroid_sd_px * config.centroid_sd_px + led_px * led_px;
}

double LedFinder::Search::unexplained_cost(BlobSpan blobs, const Assignment& a) const {
  // Long blobs are two LEDs; motion blur makes all of them long.
  std::array<double, kMaxLeds> stretch{};
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < kMaxLeds; ++i) {
    if (a.blob[i] < 0) continue;
    const Matrix2 S =
        blobs[static_cast<std::size_t>(a.blob[i])].spread + 0.1 * Matrix2::Identity();
    const double half = S.trace() / 2;
    const double gap = std::sqrt(std::max(half * half - S.determinant(), 0.0));
    stretch[i] = (half + gap) / std::max(half - gap, 1e-3);
    least = std::min(least, stretch[i]);
  }
  double cost = 0;
  for (std::size_t i = 0; i < kMaxLeds; ++i) {
    if (a.blob[i] < 0 || stretch[i] < kLong * least) continue;
    const auto shown = std::count(a.blob.begin(), a.blob.end(), a.blob[i]);
    if (shown == 1) cost += config.missing_cost / 2;
  }
  return cost;
}

bool LedFinder::Search::settle(BlobSpan blobs, bool white_is_any, Candidate& candidate,
                               PoseFit& fit) const {
  for (int pass = 0; pass < 3; ++pass) {
    LedImages images = led_images(camera, leds, candidate.X_NB);
    auto seen = observations(candidate.assignment, images, blobs, 0.15);
    for (LedObservation& o : seen) {
      o.cov += sigma2(candidate.X_NB) * Matrix2::Identity();
    }
    const auto refined = refine_pose(camera, leds, {seen.data(), seen.size()},
                                     candidate.X_NB, nullptr, 15);
    if (!refined || !plausible(refined->X_NB)) return false;
    fit = *refined;
    candidate.X_NB = fit.X_NB;
    const double tilt =
        angle_of_cosine(fit.X_NB.linear()(2, 2)) / (config.tilt_sd_deg * kDegree);
    candidate.score = fit.chi2 + tilt * tilt +
                      unexplained_cost(blobs, candidate.assignment) +
                      config.missing_cost * (leds.size() - candidate.assignment.leds) +
                      2.0 * (candidate.assignment.leds - candidate.assignment.blobs);
    images = led_images(camera, leds, fit.X_NB);
    const double sd = std::sqrt(sigma2(fit.X_NB));
    const MatchRule rule{std::clamp(3.5 * sd, 1.5, 2 * config.rms_max_px),
                         config.merge_px, config.use_color, white_is_any};
    const Assignment again = match_leds(images, leds, blobs, usable, rule);
    if (again == candidate.assignment) return true;
    if (again.blobs < 4) return false;
    candidate.assignment = again;
  }
  return fit.rms_px <= config.rms_max_px;
}

bool LedFinder::Search::same_answer(BlobSpan blobs, const Candidate& best,
                                    const Candidate& other) const {
  if (!rivals(other.X_NB, best.X_NB)) return true;
  for (std::size_t i = 0; i < kMaxLeds; ++i) {
    const int a = best.assignment.blob[i], b = other.assignment.blob[i];
    if (a >= 0 && b >= 0 && a != b) return false;
  }
  const LedImages images = led_images(camera, leds, best.X_NB);
  auto seen = observations(best.assignment, images, blobs, 0.15);
  for (LedObservation& o : seen) o.cov += sigma2(best.X_NB) * Matrix2::Identity();
  const auto fit =
      refine_pose(camera, leds, {seen.data(), seen.size()}, other.X_NB, nullptr, 15);
  return fit && !rivals(fit->X_NB, best.X_NB);
}

Result<FoundLeds> LedFinder::Search::decide(BlobSpan blobs, bool white_is_any, Time t) {
  settled.clear();
  const Settled* first = nullptr;
  for (const Candidate& candidate : kept) {
    Settled s;
    s.candidate = candidate;
    const LedImages at = led_images(camera, leds, candidate.X_NB);
    s.candidate.assignment = match_leds(
        at, leds, blobs, usable,
        {2 + kFineShare * at.size_px, config.merge_px, config.use_color, white_is_any});
    if (s.candidate.assignment.blobs < 4) continue;
    if (!settle(blobs, white_is_any, s.candidate, s.fit)) continue;
    settled.push_back(s);
    if (s.fit.rms_px > config.rms_max_px) continue;
    if (first == nullptr || s.candidate.score < first->candidate.score) {
      first = &settled.back();
    }
  }
  if (first == nullptr) return fail(Fault::too_few_points);
  const Candidate& best = first->candidate;

  FoundLeds found;
  found.fit = first->fit;
  found.score = best.score;
  found.runner_up_score = std::numeric_limits<double>::infinity();
  for (const auto& [other, fit] : settled) {
    if (other.score >= found.runner_up_score || same_answer(blobs, best, other))
      continue;
    found.runner_up_score = other.score;
    found.fit.X_NB_runner_up = other.X_NB;
    found.fit.runner_up_rms_px = fit.rms_px;
  }

  // Expected number of answers as good from lights that have nothing to do with the
  // drone: lights about it would each have to lie on an LED by chance.
  const LedImages images = led_images(camera, leds, best.X_NB);
  const double reach = 1.5 * images.size_px + 5;
  int about = 1;
  for (const int j : usable) {
    const bool used =
        std::find(best.assignment.blob.begin(), best.assignment.blob.end(), j) !=
        best.assignment.blob.end();
    const Vector2& uv = blobs[static_cast<std::size_t>(j)].uv;
    if (!used && (uv - images.middle).norm() < reach) ++about;
  }
  const int beyond = best.assignment.blobs - 3;
  const double near = std::max(0.5, 2 * found.fit.rms_px) / reach;
  const double log_chance = std::log(std::min(1.0, about * near * near));
  const double log_alarms =
      std::log(static_cast<double>(std::max<std::int64_t>(tried, 1))) +
      log_choose(leds.size() - 3, std::min(beyond, leds.size() - 3)) +
      beyond * log_chance;
  if (best.assignment.leds < std::min(5, leds.size()) &&
      unexplained_cost(blobs, best.assignment) > 0) {
    return fail(Fault::too_few_points);
  }
  if (log_alarms > std::log(config.false_alarms_max))
    return fail(Fault::too_few_points);
  if (found.runner_up_score - found.score < config.runner_up_margin) {
    return fail(Fault::ambiguous);
  }

  found.frame.t = t;
  found.frame.seen = observations(best.assignment, images, blobs, 0.15);
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    const bool used =
        std::find(best.assignment.blob.begin(), best.assignment.blob.end(),
                  static_cast<int>(j)) != best.assignment.blob.end();
    if (!used) found.frame.refused.push_back({blobs[j].uv, Refusal::no_led_near});
  }
  return found;
}

void LedFinder::Search::split_long(BlobSpan blobs) {
  split.assign(blobs.begin(), blobs.end());
  double least = std::numeric_limits<double>::infinity();
  for (const Blob& blob : blobs) least = std::min(least, stretch_of(blob));
  for (const Blob& blob : blobs) {
    if (blob.area_px > 100 || stretch_of(blob) < kLong * least) continue;
    if (split.size() + 2 > 2 * kMaxBlobs) break;
    // Two equal lights lie one standard deviation of what they add to either side.
    const Matrix2& S = blob.spread;
    const double half = S.trace() / 2;
    const double gap = std::sqrt(std::max(half * half - S.determinant(), 0.0));
    const double way = std::atan2(2 * S(0, 1), S(0, 0) - S(1, 1)) / 2;
    for (const double sign : {1.0, -1.0}) {
      Blob part = blob;
      part.uv += sign * std::sqrt(2 * gap) * Vector2(std::cos(way), std::sin(way));
      part.cov += 0.1 * Matrix2::Identity();
      part.spread -= 2 * gap * Vector2(std::cos(way), std::sin(way)) *
                     Vector2(std::cos(way), std::sin(way)).transpose();
      split.push_back(part);
    }
  }
}

Result<FoundLeds> LedFinder::Search::find_standard(BlobSpan blobs, Time t) {
  Result<FoundLeds> found = fail(Fault::too_few_points);
  // Washed-out LEDs look white, and so do lamps: they are let in only when the lights
  // of a true colour do not do.
  split_long(blobs);
  const BlobSpan parts(split);
  for (const bool white_is_any : {false, true}) {
    if (white_is_any && !config.use_color) break;
    prepare(parts, white_is_any);
    if (usable.size() < 4) continue;
    search_triples(parts, white_is_any);
    // From here on the blobs as they were seen; the parts only served the search.
    std::erase_if(usable, [&](int j) { return j >= static_cast<int>(blobs.size()); });
    found = decide(blobs, white_is_any, t);
    if (found || found.error().fault == Fault::ambiguous) break;
  }
  return found;
}

Result<DetectResult> detect_once(const Rig& rig, const ImageView& image,
                                 const DepthView& depth,
                                 const BlobDetectorConfig& blob_config,
                                 const LedFinderConfig& finder_config) {
  auto detector = BlobDetector::create(blob_config, rig.camera.intrinsics.width,
                                       rig.camera.intrinsics.height);
  if (!detector) return fail(detector.error());
  auto finder = LedFinder::create(finder_config, rig.camera, rig.leds);
  if (!finder) return fail(finder.error());
  const auto blobs = detector->detect(image, depth);
  if (!blobs) return fail(blobs.error());
  DetectResult result;
  result.blobs.assign(blobs->begin(), blobs->end());
  result.found = finder->find(*blobs);
  return result;
}

}  // namespace alight
