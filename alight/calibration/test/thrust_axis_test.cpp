#include "alight/calibration/thrust_axis.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

#include "alight/base/rng.h"
#include "alight/geometry/so3.h"

namespace alight {
namespace {

/// Ten seconds of flight to and fro, seen by LEDs that are turned by `turn_rad` in B.
struct Flight {
  Vector3 turn_rad = Vector3::Zero();
  double drag = 0.2;                               // 1/s
  Vector3 wind_N = Vector3::Zero();                // m/s
  double yaw_swing = 0.6;                          // rad
  double place_sd_m = 0.001, turn_sd_rad = 0.003;  // of a picture
  double reach_m = 0.4;
  bool level = false;    // it keeps its height
  bool carried = false;  // its attitude is the hand's
  Seconds lasts = 10;

  std::vector<ObservedFrame> seen(Rng rng) const {
    Vector3 rate, phase;
    for (int k = 0; k < 3; ++k) {
      rate[k] = rng.uniform(1.2, 2.2);
      phase[k] = rng.uniform(0, 6);
    }
    std::vector<ObservedFrame> frames;
    for (Seconds t = 0; t < lasts; t += 1.0 / 60) {
      Vector3 p(-1.2, 0, 0.5), v(0, 0, 0), a(0, 0, 0);
      for (int k = 0; k < (level ? 2 : 3); ++k) {
        const double s = rate[k] * t + phase[k];
        p[k] += reach_m * std::sin(s);
        v[k] = reach_m * rate[k] * std::cos(s);
        a[k] = -reach_m * rate[k] * rate[k] * std::sin(s);
      }
      const double yaw = yaw_swing * std::sin(0.9 * t);
      Vector3 z = (a + Vector3(0, 0, kGravity) + drag * (v - wind_N)).normalized();
      if (carried) z = Vector3(0.2 * std::sin(3.1 * t), 0.2 * std::sin(2.3 * t), 1);
      z.normalize();
      const Vector3 y = z.cross(Vector3(std::cos(yaw), std::sin(yaw), 0)).normalized();
      Matrix3 R_NB;
      R_NB << y.cross(z), y, z;
      ObservedFrame frame;
      frame.t = from_seconds(t);
      const auto noise = [&](double sd) {
        const double x = rng.normal(0, sd), y2 = rng.normal(0, sd);
        return Vector3(x, y2, rng.normal(0, sd));
      };
      frame.X_NB = make_pose(R_NB * so3_exp(turn_rad) * so3_exp(noise(turn_sd_rad)),
                             p + noise(place_sd_m));
      frames.push_back(frame);
    }
    return frames;
  }
};

// LEDs that are turned by `turn` in B make an R_NB' = R_NB exp(turn), whose thrust lies
// along exp(-turn) z: turned by `turn` it lies along z.
TEST(ThrustAxis, TellsHowTheLedsAreTurnedAsWellAsItSays) {
  double sum = 0;
  constexpr int kFlights = 60;
  for (int seed = 1; seed <= kFlights; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(static_cast<std::uint64_t>(seed));
    Flight flight;
    flight.turn_rad = Vector3(rng.normal(0, 2), rng.normal(0, 3), 0) * kDegree;
    flight.drag = rng.uniform(0, 0.4);
    flight.wind_N = Vector3(rng.normal(0, 0.5), rng.normal(0, 0.5), 0);
    ThrustAxisConfig config;
    config.sd_min_deg = 0.05;  // these rotors are mounted well
    const auto found = find_thrust_axis(config, flight.seen(rng.fork("flight")));
    ASSERT_TRUE(found) << found.error().detail;
    const Vector2 off = found->turn_rad - flight.turn_rad.head<2>();
    EXPECT_LT(off.norm(), 0.8 * kDegree);
    EXPECT_GT(found->follows, 0.95);
    EXPECT_GE(found->windows, 25);
    sum += off.dot(found->cov.llt().solve(off));
  }
  // 2 each where the covariance is true.
  EXPECT_GT(sum / kFlights, 0.8);
  EXPECT_LT(sum / kFlights, 3.2);
}

TEST(ThrustAxis, HardlyKnowsTheTurnInAWindThatAlwaysBlowsOnTheSameSide) {
  Flight flight;
  flight.level = true;
  flight.yaw_swing = 0;
  const auto straight = find_thrust_axis({}, flight.seen(Rng(3)));
  flight.yaw_swing = 0.6;
  const auto swinging = find_thrust_axis({}, flight.seen(Rng(3)));
  ASSERT_TRUE(straight);
  ASSERT_TRUE(swinging);
  EXPECT_GT(straight->cov.trace(), 3 * swinging->cov.trace());
}

TEST(ThrustAxis, RefusesWhatIsNoFreeFlight) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Flight hand;
    hand.carried = true;
    const auto found = find_thrust_axis({}, hand.seen(Rng(seed)));
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().fault, Fault::degenerate);
    EXPECT_NE(found.error().detail.find("by hand"), std::string::npos);
  }
}

TEST(ThrustAxis, RefusesADroneThatHardlyMovesAndAShortFlight) {
  Flight still;
  still.reach_m = 0.02;
  const auto found = find_thrust_axis({}, still.seen(Rng(1)));
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, Fault::degenerate);
  Flight brief;
  brief.lasts = 2;
  const auto few = find_thrust_axis({}, brief.seen(Rng(1)));
  ASSERT_FALSE(few);
  EXPECT_EQ(few.error().fault, Fault::too_few_points);
}

TEST(ThrustAxis, SinglePicturesAreNoFlight) {
  Rng rng(5);
  std::vector<ObservedFrame> frames = Flight{}.seen(rng);
  for (ObservedFrame& frame : frames) frame.t *= 20;  // three a second
  const auto found = find_thrust_axis({}, frames);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().fault, Fault::too_few_points);
  EXPECT_FALSE(find_thrust_axis({}, {}));
}

}  // namespace
}  // namespace alight
