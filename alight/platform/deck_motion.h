#pragma once
#include <array>

#include "alight/platform/platform_tracker.h"

namespace alight {

/// How the deck will press from below: the specific force of what rests on it, level
/// with the deck, in N, m/s^2. A deck in a sea swings, so that it will soon press
/// straight again; one that drives in a circle under the same force will not.
///
/// How it swings is learnt as it goes: at each of four horizons, on each axis, a
/// linear model from what is known now (tilt, its rate, acceleration, angular
/// acceleration) to the force then, by recursive least squares with forgetting (Ljung
/// 1999, ch. 11). It is believed where it has lately been nearer than constant turn
/// rate and acceleration: in a sea of 6 s it is off by 0.4 to 0.9 deg after half a
/// second, and those by 2 to 3.
///
/// No allocation; the same calls give the same bits.
class DeckMotion {
 public:
  static constexpr Seconds kFarthest = 1;  ///< Nothing is learnt beyond.

  /// Each step of the brain, for what rests at `point_N`.
  void add(Time now, const PlatformTracker& tracker, const Vector3& point_N);

  /// `ahead` s from the last `add`, at most kFarthest. Zero before the first.
  Vector2 force_N(Seconds ahead) const;
  /// sd of its error on each axis as of late, m/s^2.
  double sd(Seconds ahead) const;
  /// sd with which the share of it that weight has, by the deck's tilt, has swung about
  /// its mean as of late, m/s^2. What turns and speeds up on a level floor does not
  /// swing.
  double swing() const;

 private:
  static constexpr int kHorizons = 4;
  static constexpr int kFeatures = 5;
  static constexpr int kLag = 5;  // samples from one horizon to the next
  static constexpr int kSamples = kHorizons * kLag + 1;
  using Features = Eigen::Matrix<double, kFeatures, 2>;  // of each axis
  using Weights = Eigen::Matrix<double, kFeatures, 1>;

  struct Sample {
    Features features = Features::Zero();
    std::array<Vector2, kHorizons> carried;   // by constant turn rate and acceleration
    std::array<Vector2, kHorizons> foretold;  // and by the model
  };
  struct Model {
    std::array<Eigen::Matrix<double, kFeatures, kFeatures>, 2> normal;
    std::array<Weights, 2> right, weights;
    double carried_square = 0, foretold_square = 0;  // of errors
    double judged = 0;                               // so many of them
    Model();
  };

  /// The horizons that an instant lies between, and how far on from the first; -1 is
  /// now.
  struct Between {
    int from, to;
    double share;
  };
  static Between between(Seconds ahead);
  static Seconds seconds_to(int horizon);
  Features features() const;
  Vector2 carried_on(Seconds ahead) const;
  Vector2 foretold(const Model& model, const Features& x, const Vector2& carried) const;
  Vector2 best(int horizon) const;
  void learn(Model& model, const Sample& then, int horizon);

  bool started_ = false;
  Time sampled_ = 0;
  PlatformState platform_;
  Vector3 point_N_ = Vector3::Zero();
  Vector2 force_ = Vector2::Zero();
  Features features_ = Features::Zero();
  std::array<Model, kHorizons> models_;
  std::array<Sample, kSamples> samples_;
  int count_ = 0;  // of samples, since the last gap
  Vector2 mean_ = Vector2::Zero();
  double square_ = 0, seen_ = 0;
};

}  // namespace alight
