#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>
#include <cmath>

#include "alight/base/median.h"
#include "alight/geometry/small_solve.h"
#include "alight/vision/led_finder_search.h"

namespace alight {
namespace {

constexpr double kHopeless = 100;  // -2 log likelihood behind the best so far
constexpr int kRoughSteps = 3;     // that show it, of as many as a fit may take:
constexpr int kSteps = 10;
constexpr double kBrighter = 1.2;         // a light than its image in the pad
constexpr double kRigDof = 2;             // of what is known of the rig's exactness
constexpr int kTakenOver = 3;             // times that a challenger takes the lead
constexpr double kAside = 0.5;            // share of the constellation's size by which
                                          // a blob may be another LED's
constexpr double kPositionShare = 0.035;  // sd of the range, as a share of it

bool uses(const Assignment& assignment, int blob) {
  return std::find(assignment.blob.begin(), assignment.blob.end(), blob) !=
         assignment.blob.end();
}

std::uint16_t leds_of(const Assignment& assignment, int blob) {
  unsigned out = 0;
  for (std::size_t i = 0; i < kMaxLeds; ++i) {
    if (assignment.blob[i] == blob) out |= 1u << i;
  }
  return static_cast<std::uint16_t>(out);
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
    // What one takes for this LED and the other for others only contradicts, too.
    const int j = std::max(a, b);
    if (j < 0) continue;
    const std::uint16_t best_leds = leds_of(best.assignment, j);
    const std::uint16_t other_leds = leds_of(other.assignment, j);
    const unsigned both = best_leds & other_leds;
    if (best_leds != 0 && other_leds != 0 && both != best_leds && both != other_leds) {
      return false;
    }
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
  int strays = 1, within = 0;
  double log_orders = 0;
  for (const int j : usable) {
    const Blob& blob = blobs[static_cast<std::size_t>(j)];
    if (!uses(assignment, j)) {
      const double off = (blob.uv - images.middle).norm();
      strays += off < about;
      const bool mirrored =
          std::any_of(twins.begin(), twins.end(), [&](const std::pair<int, int>& twin) {
            return twin.first == j && uses(assignment, twin.second);
          });
      within += off < 1.5 * reach && !mirrored;
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
  double density = std::max(strays / (kPi * about * about), light_density);
  // Lights that the answer leaves out in its own midst may be its LEDs.
  if (within >= (assignment.blobs == 4 ? 1 : assignment.blobs)) {
    density = std::max(density, (within + 1) / (2.25 * kPi * reach * reach));
  }
  const double near = std::max(0.5, 2 * best.fit.rms_px);
  return log_orders + std::log(density * area) +
         2 * std::log(density * kPi * reach * reach) +
         (assignment.blobs - 3) * std::log(density * kPi * near * near);
}

bool LedFinder::Search::decided(const BlobFit& fit) const {
  const auto ldlt = fit.information.ldlt();
  if (!(ldlt.vectorD().minCoeff() > 0)) return false;
  const Matrix6 cov = inverse_of(ldlt);
  const double range = (fit.X_NB.translation() - camera.X_NC.translation()).norm();
  const double turn = std::sqrt(cov.diagonal().tail<3>().maxCoeff());
  const double place = std::sqrt(cov.diagonal().head<3>().maxCoeff());
  return turn <= config.attitude_sd_max_deg * kDegree &&
         place <= std::max(0.02, kPositionShare * range);
}

void LedFinder::Search::challenge(BlobSpan blobs, bool white_is_any,
                                  const Settled& best) {
  challengers.clear();
  const Assignment& own = best.candidate.assignment;
  const LedImages images = led_images(camera, leds, best.fit.X_NB);
  const double sd = image_sd(best.fit.X_NB);
  const auto offer = [&](const Assignment& assignment, const Pose& X_NB_0) {
    Settled s;
    s.candidate.assignment = assignment;
    const auto terms = blob_terms(assignment, images, blobs, sd);
    const auto fitted = [&](const Pose& from, int steps) {
      return fit_blobs(camera, leds, {terms.data(), terms.size()}, tilt_sd(), from,
                       steps);
    };
    auto fit = fitted(X_NB_0, kRoughSteps);
    if (!fit || fit->cost() > best.fit.cost() + kHopeless) return;
    fit = fitted(fit->X_NB, kSteps - kRoughSteps);
    if (!fit || !plausible(fit->X_NB) || !rivals(fit->X_NB, best.fit.X_NB)) return;
    s.fit = *fit;
    s.candidate.X_NB = fit->X_NB;
    s.candidate.score =
        score_of(s.candidate, blobs, {terms.data(), terms.size()}, *fit);
    if (lead(best, s) < 2 * config.runner_up_margin) challengers.push_back(s);
  };

  // From afar a flat body looks the same turned half about its normal and half about
  // the line of sight.
  Vector3 middle = Vector3::Zero();
  Matrix3 square = Matrix3::Zero();
  for (int i = 0; i < leds.size(); ++i) {
    if (own.blob[static_cast<std::size_t>(i)] < 0) continue;
    middle += leds.p_BL(i) / own.leds;
    square += leds.p_BL(i) * leds.p_BL(i).transpose() / own.leds;
  }
  Eigen::SelfAdjointEigenSolver<Matrix3> axes;
  axes.computeDirect(square - middle * middle.transpose());
  const Vector3 centre = best.fit.X_NB * middle;
  const Vector3 sight = (centre - camera.X_NC.translation()).normalized();
  const Matrix3 R_mirrored = so3_exp(kPi * sight) * best.fit.X_NB.linear() *
                             so3_exp(kPi * axes.eigenvectors().col(0));
  offer(own, make_pose(R_mirrored, centre - R_mirrored * middle));

  if (own.blobs > 5) return;
  struct Change {
    std::uint16_t from, to;
    int blob;
  };
  FixedVector<Change, 24> changes;
  LedGroups& groups = scratch.groups;
  led_groups(images, leds, config.merge_px, groups);
  for (const LedGroup& group : groups) {
    for (std::size_t i = 0; i < kMaxLeds; ++i) {
      const int j = own.blob[i];
      if (j < 0) continue;
      const auto first = std::find(own.blob.begin(), own.blob.end(), j);
      if (first != own.blob.begin() + static_cast<std::ptrdiff_t>(i)) continue;
      const Blob& blob = blobs[static_cast<std::size_t>(j)];
      if ((blob.uv - group.middle).norm() > 4 + kAside * images.size_px) continue;
      const std::uint16_t from = leds_of(own, j);
      bool agree = true;
      for (std::size_t k = 0; k < kMaxLeds; ++k) {
        if (((group.leds >> k) & 1) == 0) continue;
        agree =
            agree && (own.blob[k] < 0 || own.blob[k] == j) &&
            (!config.use_color ||
             colors_agree(blob.color, leds.color(static_cast<int>(k)), white_is_any));
      }
      if (agree && from != group.leds) changes.push_back({from, group.leds, j});
    }
  }
  const auto changed = [](Assignment assignment, const Change& change) {
    for (std::size_t k = 0; k < kMaxLeds; ++k) {
      if (((change.from >> k) & 1) != 0) assignment.blob[k] = -1;
    }
    for (std::size_t k = 0; k < kMaxLeds; ++k) {
      if (((change.to >> k) & 1) != 0) assignment.blob[k] = change.blob;
    }
    assignment.leds += std::popcount(change.to) - std::popcount(change.from);
    return assignment;
  };
  for (std::size_t a = 0; a < changes.size(); ++a) {
    const Assignment once = changed(own, changes[a]);
    offer(once, best.fit.X_NB);
    for (std::size_t b = a + 1; b < changes.size() && own.blobs == 4; ++b) {
      if (changes[b].blob == changes[a].blob || (changes[b].to & changes[a].to) != 0) {
        continue;
      }
      offer(changed(once, changes[b]), best.fit.X_NB);
    }
  }
}

double LedFinder::Search::lead(const Settled& best, const Settled& other) const {
  // Student's t where it tells more than the normal distribution: what is off by little
  // in all is held to it.
  const auto n =
      2.0 * std::min(best.candidate.assignment.blobs, other.candidate.assignment.blobs);
  const auto unlikely = [&](const BlobFit& fit) {
    return (kRigDof + n) * std::log(1 + fit.chi2_place / kRigDof);
  };
  const double normal = other.candidate.score - best.candidate.score;
  return std::max(normal, normal - other.fit.chi2_place + unlikely(other.fit) +
                              best.fit.chi2_place - unlikely(best.fit));
}

void LedFinder::Search::polish(BlobSpan blobs, Settled& best) const {
  Assignment& assignment = best.candidate.assignment;
  for (;;) {
    const LedImages images = led_images(camera, leds, best.fit.X_NB);
    const double sd = image_sd(best.fit.X_NB);
    const double dof = 2.0 * assignment.blobs - 6;
    const double share =
        std::min(1.0, (kRigDof + best.fit.chi2_place) / (kRigDof + dof));
    const auto terms = blob_terms(assignment, images, blobs, sd * std::sqrt(share));
    const auto fit = fit_blobs(camera, leds, {terms.data(), terms.size()}, tilt_sd(),
                               best.fit.X_NB, 10);
    if (!fit || rivals(fit->X_NB, best.fit.X_NB) || !plausible(fit->X_NB)) return;
    best.fit = *fit;
    if (assignment.blobs <= 5 || fit->rms_px <= std::max(config.rms_max_px, 1.5 * sd)) {
      return;
    }
    // One is off by more than LEDs and centroids usually are.
    const BlobTerm* worst = nullptr;
    double most = 0;
    for (const BlobTerm& term : terms) {
      const auto uv = project_observation(camera, fit->X_NB, leds, term.leds);
      const double off = uv ? (*uv - term.uv).norm() : 1e9;
      if (off <= most) continue;
      most = off;
      worst = &term;
    }
    for (std::size_t i = 0; i < kMaxLeds; ++i) {
      if (((worst->leds >> i) & 1) == 0) continue;
      assignment.blob[i] = -1;
      --assignment.leds;
    }
    --assignment.blobs;
  }
}

bool LedFinder::Search::holds_another(BlobSpan blobs, const Settled& best) const {
  const Assignment& own = best.candidate.assignment;
  return std::any_of(settled.begin(), settled.end(), [&](const Settled& other) {
    const Assignment& lights = other.candidate.assignment;
    const bool shares = std::any_of(lights.blob.begin(), lights.blob.end(),
                                    [&](int j) { return j >= 0 && uses(own, j); });
    return !shares && lights.blobs >= own.blobs && fits(other) &&
           !by_chance(blobs, other);
  });
}

bool LedFinder::Search::by_chance(BlobSpan blobs, const Settled& s) const {
  return log_false_alarms(blobs, s) > std::log(config.false_alarms_max);
}

bool LedFinder::Search::fits(const Settled& s) const {
  return s.fit.rms_px <= std::max(config.rms_max_px, 3 * image_sd(s.candidate.X_NB));
}

void LedFinder::Search::leave_open(BlobSpan blobs, const Settled& best) {
  open.clear();
  const bool lamps = by_chance(blobs, best);
  const auto add = [&](const Settled& s) {
    if (lead(best, s) > 4 * config.runner_up_margin) return;
    for (const LedRival& other : open) {
      if (!rivals(other.X_NB, s.fit.X_NB)) return;
    }
    const auto ldlt = s.fit.information.ldlt();
    if (!(ldlt.vectorD().minCoeff() > 0)) return;
    open.push_back({s.fit.X_NB, inverse_of(ldlt), s.candidate.assignment.blobs, lamps});
  };
  add(best);
  std::sort(settled.begin(), settled.end(), [](const Settled& a, const Settled& b) {
    return a.candidate.score < b.candidate.score;
  });
  for (const Settled& s : settled) add(s);
  for (const Settled& s : challengers) add(s);
}

Result<FoundLeds> LedFinder::Search::decide(BlobSpan blobs, bool white_is_any, Time t) {
  settled.clear();
  most_blobs = 0;
  const Settled* best = nullptr;
  std::sort(kept.begin(), kept.end(),
            [](const Candidate& a, const Candidate& b) { return a.score < b.score; });
  for (const Candidate& candidate : kept) {
    Settled s;
    s.candidate = candidate;
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
  most_blobs = best->candidate.assignment.blobs;
  if (!fits(*best) || by_chance(blobs, *best)) {
    challengers.clear();
    leave_open(blobs, Settled(*best));
    return fail(Fault::too_few_points);
  }

  FoundLeds found;
  found.runner_up_score = std::numeric_limits<double>::infinity();
  // Who beats the one he challenges takes his place.
  Settled leader = *best;
  challenge(blobs, white_is_any, leader);
  for (int n = 0; n < kTakenOver; ++n) {
    const Settled* better = nullptr;
    double most = 0;
    for (const Settled& s : challengers) {
      if (const double l = lead(leader, s); l < most) {
        most = l;
        better = &s;
      }
    }
    if (better == nullptr) break;
    (void)settled.push_back(leader);
    leader = *better;
    challenge(blobs, white_is_any, leader);
  }
  best = &leader;
  const Candidate& chosen = leader.candidate;
  found.score = chosen.score;
  const auto oppose = [&](const Settled& other) {
    const double score = found.score + lead(*best, other);
    if (score >= found.runner_up_score || same_answer(blobs, chosen, other.candidate)) {
      return;
    }
    found.runner_up_score = score;
    found.fit.X_NB_runner_up = other.candidate.X_NB;
    found.fit.runner_up_rms_px = other.fit.rms_px;
  };
  for (const Settled& other : settled) oppose(other);
  for (const Settled& other : challengers) oppose(other);
  if (found.runner_up_score - found.score < config.runner_up_margin) {
    leave_open(blobs, Settled(*best));
    return fail(Fault::ambiguous);
  }
  Settled answer = *best;
  polish(blobs, answer);
  if (!decided(answer.fit)) {
    leave_open(blobs, Settled(*best));
    return fail(Fault::ambiguous);
  }

  found.fit.X_NB = answer.fit.X_NB;
  found.fit.cov = inverse_of(answer.fit.information.ldlt());
  found.fit.chi2 = answer.fit.chi2_place;
  found.fit.rms_px = answer.fit.rms_px;
  found.frame.t = t;
  found.another = holds_another(blobs, *best);
  const LedImages images = led_images(camera, leds, answer.fit.X_NB);
  const Assignment& used = answer.candidate.assignment;
  found.frame.seen = observations(used, images, blobs, 0.15);
  for (const LedObservation& o : found.frame.seen) {
    const int led = std::countr_zero(o.leds);
    const int j = used.blob[static_cast<std::size_t>(led)];
    found.in_color += blobs[static_cast<std::size_t>(j)].color == leds.color(led);
  }
  for (int j = 0; j < static_cast<int>(blobs.size()); ++j) {
    if (uses(used, j)) continue;
    const bool dropped = uses(chosen.assignment, j);
    found.frame.refused.push_back(
        {blobs[static_cast<std::size_t>(j)].uv,
         dropped ? Refusal::off_constellation : Refusal::no_led_near});
  }
  return found;
}

}  // namespace alight
