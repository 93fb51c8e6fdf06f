#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alight/base/median.h"
#include "alight/vision/led_finder_search.h"

namespace alight {
namespace {

constexpr double kHopeless = 100;         // -2 log likelihood behind the best so far
constexpr double kBrighter = 1.2;         // a light than its image in the pad
constexpr double kPositionShare = 0.035;  // sd of the range, as a share of it

bool uses(const Assignment& assignment, int blob) {
  return std::find(assignment.blob.begin(), assignment.blob.end(), blob) !=
         assignment.blob.end();
}

}  // namespace

bool rivals(const Pose& a, const Pose& b) {
  return (a.linear().transpose() * b.linear()).trace() <
             1 + 2 * std::cos(12 * kDegree) ||
         (a.translation() - b.translation()).squaredNorm() > 0.15 * 0.15;
}

double LedFinder::Search::brightness_cost(const Assignment& assignment,
                                          BlobSpan blobs) const {
  FixedVector<double, kMaxLeds> logs;
  for (int i = 0; i < leds.size(); ++i) {
    const int j = assignment.blob[static_cast<std::size_t>(i)];
    if (j < 0) continue;
    const auto sharing = std::count(assignment.blob.begin(), assignment.blob.end(), j);
    const double light = blobs[static_cast<std::size_t>(j)].brightness;
    logs.push_back(std::log(std::max(1.0, light / static_cast<double>(sharing))));
  }
  if (logs.empty()) return 0;
  FixedVector<double, kMaxLeds> sorted = logs;
  const double usual = median(sorted.begin(), sorted.end());
  double cost = 0;
  for (const double l : logs) {
    const double off = (l - usual) / config.brightness_sd;
    cost += std::min(off * off, config.mirror_cost);
  }
  return cost;
}

double LedFinder::Search::score_of(const Candidate& candidate, BlobSpan blobs,
                                   std::span<const BlobTerm> terms,
                                   const BlobFit& fit) const {
  double score = fit.cost() +
                 config.missing_cost * (leds.size() - candidate.assignment.leds) +
                 2.0 * (candidate.assignment.leds - candidate.assignment.blobs) +
                 brightness_cost(candidate.assignment, blobs);
  // Each blob in use is one that need not be a stray light.
  for (const BlobTerm& term : terms) {
    score += std::log(term.cov.determinant()) + 2 * std::log(2 * kPi * light_density) +
             4 * std::log(std::max(term.stretch_sd, 0.5));
  }
  for (const auto& [image, light] : twins) {
    if (uses(candidate.assignment, image) && !uses(candidate.assignment, light)) {
      score += config.mirror_cost;
    }
  }
  return score;
}

void LedFinder::Search::find_twins(BlobSpan blobs) {
  twins.clear();
  const PadMirror mirror(camera, pad_size_m);
  for (const int i : usable) {
    const Blob& image = blobs[static_cast<std::size_t>(i)];
    if (!mirror.shows(image.uv)) continue;
    for (const int j : usable) {
      const Blob& light = blobs[static_cast<std::size_t>(j)];
      if (light.color == image.color &&
          light.brightness > kBrighter * image.brightness &&
          mirror.may_mirror(light.uv, image.uv) && twins.size() < kTwins) {
        twins.emplace_back(i, j);
      }
    }
  }
}

bool LedFinder::Search::settle(BlobSpan blobs, bool white_is_any, double best_score,
                               Settled& s) {
  Candidate& candidate = s.candidate;
  for (int pass = 0; pass < 4; ++pass) {
    LedImages images = led_images(camera, leds, candidate.X_NB);
    const double sd = image_sd(candidate.X_NB);
    const auto terms = blob_terms(candidate.assignment, images, blobs, sd);
    const auto fit = fit_blobs(camera, leds, {terms.data(), terms.size()}, tilt_sd(),
                               candidate.X_NB, pass == 0 ? 5 : 10);
    if (!fit || !plausible(fit->X_NB)) return false;
    s.fit = *fit;
    candidate.X_NB = fit->X_NB;
    candidate.score = score_of(candidate, blobs, {terms.data(), terms.size()}, *fit);
    // No second look gains as much as that.
    if (candidate.score > best_score + kHopeless) return false;
    images = led_images(camera, leds, fit->X_NB);
    const GroupRule rule{std::max(3.5 * sd, 1.5), sd,          4, config.merge_px,
                         config.use_color,        white_is_any};
    const Assignment again = match_groups(images, leds, blobs, usable, rule, scratch);
    if (again == candidate.assignment) break;
    if (again.blobs < 4) return false;
    if (pass == 3) break;
    candidate.assignment = again;
  }
  return true;
}

bool LedFinder::Search::same_answer(BlobSpan blobs, const Candidate& best,
                                    const Candidate& other) const {
  if (!rivals(other.X_NB, best.X_NB)) return true;
  for (std::size_t i = 0; i < kMaxLeds; ++i) {
    const int a = best.assignment.blob[i], b = other.assignment.blob[i];
    if (a >= 0 && b >= 0 && a != b) return false;
  }
  const LedImages images = led_images(camera, leds, best.X_NB);
  const auto terms = blob_terms(best.assignment, images, blobs, image_sd(best.X_NB));
  const auto fit =
      fit_blobs(camera, leds, {terms.data(), terms.size()}, tilt_sd(), other.X_NB, 15);
  return fit && !rivals(fit->X_NB, best.X_NB);
}

double LedFinder::Search::log_false_alarms(BlobSpan blobs, const Settled& best) const {
  const Assignment& assignment = best.candidate.assignment;
  const LedImages images = led_images(camera, leds, best.candidate.X_NB);
  const double reach = images.size_px + 5, about = 4 * reach;
  int strays = 1;
  double log_orders = 0;
  for (const int j : usable) {
    const Blob& blob = blobs[static_cast<std::size_t>(j)];
    if (!uses(assignment, j)) {
      strays += (blob.uv - images.middle).norm() < about;
      continue;
    }
    int fitting = 0;
    for (const Led& led : leds.leds) {
      fitting += !config.use_color || colors_agree(blob.color, led.color, true);
    }
    log_orders += std::log(fitting);
  }
  const double area =
      static_cast<double>(camera.intrinsics.width) * camera.intrinsics.height;
  const double density = std::max(strays / (kPi * about * about), light_density);
  const double near = std::max(0.5, 2 * best.fit.rms_px);
  return log_orders + std::log(density * area) +
         2 * std::log(density * kPi * reach * reach) +
         (assignment.blobs - 3) * std::log(density * kPi * near * near);
}

bool LedFinder::Search::decided(const BlobFit& fit) const {
  const auto ldlt = fit.information.ldlt();
  if (!(ldlt.vectorD().minCoeff() > 0)) return false;
  const Matrix6 cov = ldlt.solve(Matrix6::Identity());
  const double range = (fit.X_NB.translation() - camera.X_NC.translation()).norm();
  const double turn = std::sqrt(cov.diagonal().tail<3>().maxCoeff());
  const double place = std::sqrt(cov.diagonal().head<3>().maxCoeff());
  return turn <= config.attitude_sd_max_deg * kDegree &&
         place <= std::max(0.02, kPositionShare * range);
}

void LedFinder::Search::polish(FoundLeds& found) const {
  // Where the places alone decide the pose, usual tilt and shapes have no say in it.
  const double sd = image_sd(found.fit.X_NB);
  while (found.frame.seen.size() >= 5) {
    auto seen = found.frame.seen;
    for (LedObservation& o : seen) o.cov += sd * sd * Matrix2::Identity();
    const auto fit = refine_pose(camera, leds, {seen.data(), seen.size()},
                                 found.fit.X_NB, nullptr, 15);
    if (!fit || rivals(fit->X_NB, found.fit.X_NB) || !plausible(fit->X_NB)) return;
    const double turn = std::sqrt(fit->cov.diagonal().tail<3>().maxCoeff());
    if (turn > config.attitude_sd_max_deg * kDegree) return;
    found.fit.X_NB = fit->X_NB;
    found.fit.cov = fit->cov;
    found.fit.chi2 = fit->chi2;
    found.fit.rms_px = fit->rms_px;
    if (seen.size() == 5 || fit->rms_px <= std::max(config.rms_max_px, 1.5 * sd)) {
      return;
    }
    // One is off by more than LEDs and centroids usually are.
    std::size_t worst = 0;
    double most = 0;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const auto uv = project_observation(camera, fit->X_NB, leds, seen[i].leds);
      const double off = uv ? (*uv - seen[i].uv).norm() : 1e9;
      if (off <= most) continue;
      most = off;
      worst = i;
    }
    auto rest = seen;
    rest.erase(worst);
    const auto again =
        refine_pose(camera, leds, {rest.data(), rest.size()}, fit->X_NB, nullptr, 15);
    if (!again || rivals(again->X_NB, fit->X_NB) || !plausible(again->X_NB)) return;
    found.frame.refused.push_back({seen[worst].uv, Refusal::off_constellation});
    found.frame.seen.erase(worst);
  }
}

Result<FoundLeds> LedFinder::Search::decide(BlobSpan blobs, bool white_is_any, Time t) {
  settled.clear();
  rough.clear();
  find_twins(blobs);
  const Settled* best = nullptr;
  std::sort(kept.begin(), kept.end(),
            [](const Candidate& a, const Candidate& b) { return a.score < b.score; });
  for (const Candidate& candidate : kept) {
    Settled s;
    s.candidate = candidate;
    const LedImages at = led_images(camera, leds, candidate.X_NB);
    const GroupRule rule{2 + 0.05 * at.size_px, 1,           5, config.merge_px,
                         config.use_color,      white_is_any};
    s.candidate.assignment = match_groups(at, leds, blobs, usable, rule, scratch);
    if (s.candidate.assignment.blobs < 4) continue;
    const auto same = [&](const Candidate& other) {
      return other.assignment == s.candidate.assignment &&
             !rivals(other.X_NB, s.candidate.X_NB);
    };
    if (std::any_of(rough.begin(), rough.end(), same)) continue;
    rough.push_back(s.candidate);
    const double so_far = best == nullptr ? 0 : best->candidate.score;
    if (!settle(blobs, white_is_any, so_far, s) ||
        s.candidate.score > so_far + 4 * config.runner_up_margin) {
      continue;
    }
    settled.push_back(s);
    if (best == nullptr || s.candidate.score < best->candidate.score) {
      best = &settled.back();
    }
  }
  if (best == nullptr) return fail(Fault::too_few_points);
  const Candidate& chosen = best->candidate;
  if (best->fit.rms_px > std::max(config.rms_max_px, 3 * image_sd(chosen.X_NB)) ||
      log_false_alarms(blobs, *best) > std::log(config.false_alarms_max)) {
    return fail(Fault::too_few_points);
  }

  FoundLeds found;
  found.score = chosen.score;
  found.runner_up_score = std::numeric_limits<double>::infinity();
  for (const auto& [other, fit] : settled) {
    if (other.score >= found.runner_up_score ||
        other.score > chosen.score + 4 * config.runner_up_margin ||
        same_answer(blobs, chosen, other)) {
      continue;
    }
    found.runner_up_score = other.score;
    found.fit.X_NB_runner_up = other.X_NB;
    found.fit.runner_up_rms_px = fit.rms_px;
  }
  if (found.runner_up_score - found.score < config.runner_up_margin ||
      !decided(best->fit)) {
    return fail(Fault::ambiguous);
  }

  found.fit.X_NB = best->fit.X_NB;
  found.fit.cov = best->fit.information.ldlt().solve(Matrix6::Identity());
  found.fit.chi2 = best->fit.chi2_place;
  found.fit.rms_px = best->fit.rms_px;
  found.frame.t = t;
  const LedImages images = led_images(camera, leds, chosen.X_NB);
  found.frame.seen = observations(chosen.assignment, images, blobs, 0.15);
  polish(found);
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    if (uses(chosen.assignment, static_cast<int>(j))) continue;
    found.frame.refused.push_back({blobs[j].uv, Refusal::no_led_near});
  }
  return found;
}

}  // namespace alight
