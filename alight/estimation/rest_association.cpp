#include "alight/estimation/rest_association.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "alight/base/fixed_vector.h"
#include "alight/estimation/rest_model.h"

namespace alight {
namespace {

// Of a blob's middle, px; at first what the linearization is off by besides.
constexpr double kPixelSd = 0.5, kFirstPixelSd = 3;
constexpr double kGate = 20;     // chi-square of 2 degrees of freedom
constexpr double kSeen = 0.98;   // LEDs that are
constexpr double kLamps = 1e-4;  // lights that are no LEDs, px^-2
constexpr double kMargin = 6;    // -2 log likelihood from which on no doubt is left
constexpr int kNodesMost = 20000;
constexpr std::size_t kBest = 4;  // answers that are looked at more closely
constexpr int kRounds = 4;

constexpr int kRows = 2 * kMaxLeds;
using Images = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kRows, 1>;
using ImagesCovariance =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kRows, kRows>;

/// Images that are expected, of all LEDs together.
struct Expected {
  Images mean;
  ImagesCovariance cov;
};

std::optional<Expected> expected_about(const Rest& start, const RestUnknowns& sd,
                                       const RestUnknowns& x) {
  const Rest rest = moved(start, x);
  const int n = rest.leds.size();
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kRows, kRestMost> J(
      2 * n, sd.size());
  Expected out;
  out.mean.resize(2 * n);
  RestRow J_i;
  for (int i = 0; i < n; ++i) {
    const auto uv = rest_image(rest, x, static_cast<std::uint16_t>(1u << i), J_i);
    if (!uv) return std::nullopt;
    out.mean.segment<2>(2 * i) = *uv - J_i * x;
    J.middleRows<2>(2 * i) = J_i * sd.asDiagonal();
  }
  out.cov = J.lazyProduct(J.transpose());
  return out;
}

struct Answer {
  RestAssociation light;
  double score = 0;  ///< -2 log likelihood, up to a constant.
  int leds = 0;
};
using Answers = FixedVector<Answer, kBest>;

/// One that only leaves an LED out says nothing else.
bool contradicts(const Answer& a, const Answer& b) {
  for (std::size_t i = 0; i < kMaxLeds; ++i) {
    for (std::size_t k = 0; k < kMaxLeds; ++k) {
      const bool same_light = a.light[i] >= 0 && a.light[i] == b.light[k];
      if (i == k ? a.light[i] >= 0 && b.light[i] >= 0 && !same_light : same_light) {
        return true;
      }
    }
  }
  return false;
}

/// The most likely answers, the best one first.
class Search {
 public:
  Search(std::span<const RestLight> lights, int leds, double pixel_sd_px)
      : lights_(lights), R_(pixel_sd_px * pixel_sd_px) {
    const double det_least = 2 * std::log(2 * std::numbers::pi * R_);
    least_ = det_least + kMatched;
    // Those that few lights can be come first.
    std::array<int, kMaxLeds> may_be{};
    for (int i = 0; i < leds; ++i) {
      order_.push_back(i);
      for (const RestLight& light : lights) {
        may_be[static_cast<std::size_t>(i)] += (light.may_be >> i) & 1;
      }
    }
    std::sort(order_.begin(), order_.end(), [&](int a, int b) {
      const int of_a = may_be[static_cast<std::size_t>(a)];
      const int of_b = may_be[static_cast<std::size_t>(b)];
      return of_a != of_b ? of_a < of_b : a < b;
    });
  }

  /// @returns false when there are too many.
  bool run(const Expected& expected) {
    Answer none;
    none.light.fill(-1);
    go_on(expected, none, 0, 0);
    return nodes_ < kNodesMost;
  }
  const Answers& best() const { return best_; }

 private:
  // What is known of a light that is an LED, against its being a lamp, and of an LED
  // that is not seen.
  static inline const double kMatched = 2 * std::log(kLamps) - 2 * std::log(kSeen);
  static inline const double kMissing = -2 * std::log(1 - kSeen);

  void go_on(const Expected& expected, const Answer& so_far, std::size_t depth,
             std::uint64_t taken) {
    if (++nodes_ >= kNodesMost) return;
    if (depth == order_.size()) {
      offer(so_far);
      return;
    }
    const auto left = static_cast<double>(order_.size() - depth);
    if (hopeless(so_far.score + left * std::min(least_, kMissing))) return;
    const int led = order_[depth];
    const Matrix2 S =
        expected.cov.block<2, 2>(2 * led, 2 * led) + R_ * Matrix2::Identity();
    const Matrix2 W = S.inverse();
    const double log_det =
        std::log(4 * std::numbers::pi * std::numbers::pi * S.determinant());
    struct Choice {
      int light;
      double chi2;
    };
    FixedVector<Choice, kMaxRestLights> choices;
    for (std::size_t j = 0; j < lights_.size(); ++j) {
      if (((lights_[j].may_be >> led) & 1) == 0 || ((taken >> j) & 1) != 0) continue;
      const Vector2 off = lights_[j].uv - expected.mean.segment<2>(2 * led);
      const double chi2 = off.dot(W * off);
      if (chi2 < kGate) choices.push_back({static_cast<int>(j), chi2});
    }
    std::sort(choices.begin(), choices.end(),
              [](const Choice& a, const Choice& b) { return a.chi2 < b.chi2; });
    const Eigen::Matrix<double, Eigen::Dynamic, 2, 0, kRows, 2> K =
        expected.cov.middleCols<2>(2 * led) * W;
    Expected then;
    if (!choices.empty()) {
      then.cov = expected.cov - K.lazyProduct(expected.cov.middleRows<2>(2 * led));
    }
    for (const Choice& choice : choices) {
      const auto j = static_cast<std::size_t>(choice.light);
      then.mean =
          expected.mean + K * (lights_[j].uv - expected.mean.segment<2>(2 * led));
      Answer with = so_far;
      with.light[static_cast<std::size_t>(led)] = choice.light;
      with.score += choice.chi2 + log_det + kMatched;
      ++with.leds;
      go_on(then, with, depth + 1, taken | (std::uint64_t{1} << j));
    }
    Answer without = so_far;
    without.score += kMissing;
    go_on(expected, without, depth + 1, taken);
  }

  bool hopeless(double score) const {
    return best_.full() && score >= best_[best_.size() - 1].score;
  }

  void offer(const Answer& answer) {
    if (hopeless(answer.score)) return;
    if (best_.full()) best_.erase(best_.size() - 1);
    best_.push_back(answer);
    std::sort(best_.begin(), best_.end(),
              [](const Answer& a, const Answer& b) { return a.score < b.score; });
  }

  std::span<const RestLight> lights_;
  double R_, least_;
  FixedVector<int, kMaxLeds> order_;
  Answers best_;
  int nodes_ = 0;
};

}  // namespace

Result<RestAssociation> associate_at_rest(const RestCalibrationConfig& config,
                                          const Camera& camera,
                                          const Constellation& leds,
                                          std::span<const RestLight> lights,
                                          const Pose& X_NB_rest, int leds_least) {
  lights = lights.first(std::min(lights.size(), kMaxRestLights));
  const Rest start{X_NB_rest, camera, leds};
  const RestUnknowns sd = standard_deviations(config, leds.size());
  const auto about = expected_about(start, sd, RestUnknowns::Zero(sd.size()));
  if (!about) return fail(Fault::degenerate);
  Search first(lights, leds.size(), kFirstPixelSd);
  if (!first.run(*about)) return fail(Fault::ambiguous);

  // Where the first answers stand, what is expected is known better.
  FixedVector<Answer, 2 * kBest * kRounds> found;
  for (Answer answer : first.best()) {
    for (int round = 0; round < kRounds; ++round) {
      if (answer.leds < leds_least) break;
      FixedVector<LedObservation, kMaxLeds> seen;
      for (int i = 0; i < leds.size(); ++i) {
        const int j = answer.light[static_cast<std::size_t>(i)];
        if (j < 0) continue;
        LedObservation o;
        o.leds = static_cast<std::uint16_t>(1u << i);
        o.uv = lights[static_cast<std::size_t>(j)].uv;
        seen.push_back(o);
      }
      const auto fit = fit_rest(start, {seen.data(), seen.size()}, kPixelSd, sd);
      if (!fit) break;
      const auto there = expected_about(start, sd, fit->x);
      if (!there) break;
      Search again(lights, leds.size(), kPixelSd);
      if (!again.run(*there)) return fail(Fault::ambiguous);
      for (std::size_t k = 0; k < std::min<std::size_t>(again.best().size(), 2); ++k) {
        found.push_back(again.best()[k]);
      }
      const bool same = again.best()[0].light == answer.light;
      answer = again.best()[0];
      if (same) break;
    }
  }
  const auto less = [](const Answer& a, const Answer& b) { return a.score < b.score; };
  const auto best = std::min_element(found.begin(), found.end(), less);
  if (best == found.end() || best->leds < leds_least)
    return fail(Fault::too_few_points);
  for (const Answer& other : found) {
    if (contradicts(other, *best) && other.score < best->score + kMargin) {
      return fail(Fault::ambiguous);
    }
  }
  return best->light;
}

}  // namespace alight
