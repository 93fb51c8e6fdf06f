#include "alight/platform/deck_motion.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cassert>
#include <cmath>

namespace alight {
namespace {

constexpr Seconds kEvery = 0.05;  // between samples
constexpr double kMemory = 20;    // s: what is learnt fades as exp(-t / kMemory)
constexpr double kJudged = 100;   // samples by which a model is judged
constexpr double kRidge = 0.1;    // the weight of knowing nothing, in s (m/s^2)^2
constexpr double kSlack = 1.5;    // of kEvery: a longer gap starts anew

Vector3 accelerated(const PlatformState& platform, const Vector3& point_N) {
  return inertial_acceleration_N(platform, point_N, Vector3::Zero(), Vector3::Zero());
}

Vector2 pressing(const PlatformState& platform, const Vector3& point_N) {
  return (accelerated(platform, point_N) - gravity_N(platform)).head<2>();
}

/// The mean of the last `count` values or so.
void average(double& mean, double value, double count) {
  mean += (value - mean) / count;
}

}  // namespace

DeckMotion::Model::Model() {
  for (std::size_t axis = 0; axis < 2; ++axis) {
    normal[axis] = kRidge * Eigen::Matrix<double, kFeatures, kFeatures>::Identity();
    right[axis].setZero();
    weights[axis].setZero();
  }
}

Seconds DeckMotion::seconds_to(int horizon) { return (horizon + 1) * kLag * kEvery; }

DeckMotion::Features DeckMotion::features() const {
  const Vector3 up = -gravity_N(platform_);
  const Vector3 a = accelerated(platform_, point_N_);
  const Vector3 rate = -platform_.w_IN_N.cross(up);
  const Vector3 rate_rate = -platform_.alpha_IN_N.cross(up);
  Features x;
  x << up.head<2>().transpose(), rate.head<2>().transpose(), a.head<2>().transpose(),
      rate_rate.head<2>().transpose(), Vector2::Ones().transpose();
  return x;
}

Vector2 DeckMotion::carried_on(Seconds ahead) const {
  return pressing(predict(platform_, ahead), point_N_);
}

Vector2 DeckMotion::foretold(const Model& model, const Features& x,
                             const Vector2& carried) const {
  return carried +
         Vector2(model.weights[0].dot(x.col(0)), model.weights[1].dot(x.col(1)));
}

void DeckMotion::learn(Model& model, const Sample& then, int horizon) {
  const auto h = static_cast<std::size_t>(horizon);
  const double kept = std::exp(-kEvery / kMemory);
  const Vector2 off = force_ - then.carried[h];
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const Weights x = then.features.col(static_cast<Eigen::Index>(axis));
    auto& normal = model.normal[axis];
    normal = kept * normal + kEvery * x * x.transpose();
    normal.diagonal().array() += (1 - kept) * kRidge;
    model.right[axis] =
        kept * model.right[axis] + kEvery * off[static_cast<Eigen::Index>(axis)] * x;
    model.weights[axis] = normal.ldlt().solve(model.right[axis]);
  }
  model.judged = std::min(model.judged + 1, kJudged);
  average(model.carried_square, 0.5 * off.squaredNorm(), model.judged);
  average(model.foretold_square, 0.5 * (force_ - then.foretold[h]).squaredNorm(),
          model.judged);
}

void DeckMotion::add(Time now, const PlatformTracker& tracker, const Vector3& point_N) {
  if (!tracker.ready()) return;
  point_N_ = point_N;
  platform_ = tracker.at(now);
  force_ = pressing(platform_, point_N);
  features_ = features();
  const Seconds since = to_seconds(now - sampled_);
  if (started_ && since < kEvery) return;
  if (since > kSlack * kEvery) count_ = 0;
  started_ = true;
  sampled_ = now;

  for (int h = 0; h < kHorizons; ++h) {
    const int back = (h + 1) * kLag;
    if (count_ < back) break;
    learn(models_[static_cast<std::size_t>(h)],
          samples_[static_cast<std::size_t>((count_ - back) % kSamples)], h);
  }
  Sample& sample = samples_[static_cast<std::size_t>(count_ % kSamples)];
  sample.features = features_;
  for (int h = 0; h < kHorizons; ++h) {
    const auto k = static_cast<std::size_t>(h);
    sample.carried[k] = carried_on(seconds_to(h));
    sample.foretold[k] = foretold(models_[k], features_, sample.carried[k]);
  }
  ++count_;

  seen_ = std::min(seen_ + 1, kJudged);
  const Vector2 off = (-gravity_N(platform_)).head<2>() - mean_;
  mean_ += off / seen_;
  average(square_, (1 - 1 / seen_) * off.squaredNorm(), seen_);
}

Vector2 DeckMotion::best(int horizon) const {
  const Model& model = models_[static_cast<std::size_t>(horizon)];
  const Vector2 f = carried_on(seconds_to(horizon));
  return model.foretold_square < model.carried_square ? foretold(model, features_, f)
                                                      : f;
}

DeckMotion::Between DeckMotion::between(Seconds ahead) {
  assert(ahead >= 0);
  const double steps = std::min(ahead, kFarthest) / seconds_to(0);
  const int below = std::min(static_cast<int>(steps), kHorizons - 1);
  return {below - 1, below, steps - below};
}

Vector2 DeckMotion::force_N(Seconds ahead) const {
  if (!started_) return Vector2::Zero();
  const auto [from, to, share] = between(ahead);
  const Vector2 f = from < 0 ? force_ : best(from);
  return f + share * (best(to) - f);
}

double DeckMotion::sd(Seconds ahead) const {
  const auto [from, to, share] = between(ahead);
  const auto of = [&](int horizon) {
    if (horizon < 0) return 0.0;
    const Model& m = models_[static_cast<std::size_t>(horizon)];
    return std::sqrt(std::min(m.carried_square, m.foretold_square));
  };
  return of(from) + share * (of(to) - of(from));
}

double DeckMotion::swing() const { return std::sqrt(square_); }

}  // namespace alight
