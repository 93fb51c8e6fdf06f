#include "alight/estimation/rest_calibration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "alight/base/rng.h"

namespace alight {
namespace {

constexpr double kPixelSd = 0.15;

Vector3 normal3(Rng& rng, double sd) {
  return {rng.normal(0, sd), rng.normal(0, sd), rng.normal(0, sd)};
}

/// Standing in the middle of the pad, the LEDs' side towards the lens.
Pose expected_at_rest(const Rig& rig) {
  return make_pose(Matrix3::Identity(), Vector3(0, 0, rig.drone.gear_height_m));
}

std::vector<LedObservation> images(const Camera& camera, const Constellation& leds,
                                   const Pose& X_NB, double sd_px, Rng& rng) {
  std::vector<LedObservation> seen;
  for (int i = 0; i < leds.size(); ++i) {
    const auto uv = project_led(camera, X_NB, leds.p_BL(i));
    if (!uv) continue;
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << i);
    o.uv = *uv + Vector2(rng.normal(0, sd_px), rng.normal(0, sd_px));
    seen.push_back(o);
  }
  return seen;
}

/// The pose that fits the images best, from the truth: Gauss-Newton, at least four
/// LEDs.
Pose pose_of(const Camera& camera, const Constellation& leds,
             const std::vector<LedObservation>& seen, Pose X_NB) {
  for (int step = 0; step < 12; ++step) {
    Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> b = Eigen::Matrix<double, 6, 1>::Zero();
    for (const LedObservation& o : seen) {
      Matrix26 J;
      const auto uv = project_observation(camera, X_NB, leds, o.leds, &J);
      if (!uv) return X_NB;
      A += J.transpose() * J;
      b += J.transpose() * (o.uv - *uv);
    }
    const Eigen::Matrix<double, 6, 1> d = A.ldlt().solve(b);
    X_NB.translation() += d.head<3>();
    X_NB.linear() = X_NB.linear() * so3_exp(d.tail<3>());
  }
  return X_NB;
}

/// A rig as it truly is, and a drone that stands on its pad.
struct Truth {
  Camera camera;
  Constellation leds;
  Pose X_NB_rest;
};

/// What a rig file gets wrong. The LED frame against the feet is the same in flight as
/// on the pad, where it shows as a tilt.
Truth draw(const Rig& rig, Rng& rng) {
  const RestCalibrationConfig sd;
  Truth truth{rig.camera, rig.leds, expected_at_rest(rig)};
  for (Led& led : truth.leds.leds) led.p_BL += normal3(rng, sd.led_sd_m);
  truth.camera.X_NC.translation() += normal3(rng, sd.mount_position_sd_m);
  truth.camera.X_NC.linear() =
      truth.camera.X_NC.linear() *
      so3_exp(normal3(rng, sd.mount_rotation_sd_deg * kDegree));
  Intrinsics& lens = truth.camera.intrinsics;
  const double zoom = rng.normal(1, sd.focal_sd_share);
  lens.fx *= zoom;
  lens.fy *= zoom;
  lens.cx += rng.normal(0, sd.principal_sd_px);
  lens.cy += rng.normal(0, sd.principal_sd_px);
  truth.X_NB_rest.translation() +=
      Vector3(rng.normal(0, sd.place_sd_m), rng.normal(0, sd.place_sd_m),
              rng.normal(0, sd.height_sd_m));
  truth.X_NB_rest.linear() =
      so3_exp(Vector3(rng.normal(0, sd.tilt_sd_deg), rng.normal(0, sd.tilt_sd_deg),
                      rng.normal(0, sd.heading_sd_deg)) *
              kDegree);
  return truth;
}

/// A place of the approach, `range` m from the lens along its axis and a little beside.
Pose place_in_flight(const Rig& rig, double range, Rng& rng) {
  const Vector3 aside(rng.normal(0, 0.08 * range), rng.normal(0, 0.08 * range), range);
  return make_pose(
      from_rpy(rng.normal(0, 0.08), rng.normal(0, 0.08), rng.normal(0, 0.15)),
      rig.camera.X_NC * aside);
}

struct Mean {
  double sum = 0, sum2 = 0;
  int n = 0;
  void add(double x) {
    sum += x;
    sum2 += x * x;
    ++n;
  }
  double value() const { return sum / n; }
  double variance() const { return (sum2 - n * value() * value()) / (n - 1); }
  double standard_error() const { return std::sqrt(variance() / n); }
};

TEST(RestCalibration, ARigAsWrittenStaysAsWritten) {
  const Rig rig = alan_rig();
  for (unsigned seed = 0; seed < 50; ++seed) {
    Rng rng(seed);
    const Pose X_NB = make_pose(
        from_rpy(0, 0, rng.normal(0, 0.15)),
        Vector3(rng.normal(0, 0.06), rng.normal(0, 0.06), rig.drone.gear_height_m));
    const auto seen = images(rig.camera, rig.leds, X_NB, 0, rng);
    // Told where it stands, nothing is left to explain.
    const auto fit = calibrate_at_rest({}, rig.camera, rig.leds, seen, X_NB);
    ASSERT_TRUE(fit);
    EXPECT_LT(fit->chi2, 1e-9);
    EXPECT_LT(fit->rms_px, 1e-6);
    EXPECT_LT(fit->rms_before_px, 1e-6);
    EXPECT_TRUE(fit->X_NB.isApprox(X_NB, 1e-6));
    EXPECT_TRUE(fit->camera.X_NC.isApprox(rig.camera.X_NC, 1e-6));
    EXPECT_NEAR(fit->camera.intrinsics.fx, rig.camera.intrinsics.fx, 1e-4);
    EXPECT_NEAR(fit->camera.intrinsics.cx, rig.camera.intrinsics.cx, 1e-4);
    for (int i = 0; i < rig.leds.size(); ++i) {
      EXPECT_LT((fit->leds.p_BL(i) - rig.leds.p_BL(i)).norm(), 1e-7);
    }
  }
}

/// The rig as written, measured by the true one at rest.
Result<RestFit> measured(const Rig& rig, const Truth& truth, Rng& rng) {
  return calibrate_at_rest(
      {}, rig.camera, rig.leds,
      images(truth.camera, truth.leds, truth.X_NB_rest, kPixelSd, rng),
      expected_at_rest(rig));
}

// What it is told of the rig and of the drone's stand it weighs rightly: the sum of
// squares has as many degrees of freedom as there are measurements, 6 LEDs of 2
// coordinates, whatever the number of unknowns.
TEST(RestCalibration, AnswersForEveryRigAndTheSumOfSquaresIsThatOfTheMeasurements) {
  const Rig rig = alan_rig();
  Mean chi2, before, after;
  constexpr int kRigs = 1000;
  for (unsigned seed = 0; seed < kRigs; ++seed) {
    Rng rng(seed);
    const Truth truth = draw(rig, rng);
    const auto fit = measured(rig, truth, rng);
    ASSERT_TRUE(fit) << "seed " << seed;
    EXPECT_TRUE(std::isfinite(fit->chi2) && fit->X_NB.matrix().allFinite());
    chi2.add(fit->chi2);
    before.add(fit->rms_before_px);
    after.add(fit->rms_px);
  }
  EXPECT_NEAR(chi2.value(), 12, 4 * chi2.standard_error() + 0.3);
  // Twice the freedom, twice that in the variance.
  EXPECT_NEAR(chi2.variance(), 24, 5);
  EXPECT_LT(after.value(), kPixelSd);
  EXPECT_GT(before.value(), 3 * after.value());
}

// The point of it: poses in flight, from the same pictures, nearer to the truth.
TEST(RestCalibration, PosesInFlightComeNearerToTheTruth) {
  const Rig rig = alan_rig();
  Mean position, rotation;  // log of the ratio of rms errors, a rig each
  Mean constellation;       // the same of the distances between LEDs
  for (unsigned seed = 5000; seed < 5400; ++seed) {
    Rng rng(seed);
    const Truth truth = draw(rig, rng);
    const auto fit = measured(rig, truth, rng);
    ASSERT_TRUE(fit);
    double p_written = 0, p_measured = 0, R_written = 0, R_measured = 0;
    for (const double range : {0.6, 0.8, 1.0, 1.3, 1.6, 2.0}) {
      const Pose X_NB = place_in_flight(rig, range, rng);
      const auto seen = images(truth.camera, truth.leds, X_NB, kPixelSd, rng);
      const Pose written = pose_of(rig.camera, rig.leds, seen, X_NB);
      const Pose measured = pose_of(fit->camera, fit->leds, seen, X_NB);
      p_written += (written.translation() - X_NB.translation()).squaredNorm();
      p_measured += (measured.translation() - X_NB.translation()).squaredNorm();
      R_written += std::pow(angle_between(written.linear(), X_NB.linear()), 2);
      R_measured += std::pow(angle_between(measured.linear(), X_NB.linear()), 2);
    }
    position.add(0.5 * std::log(p_measured / p_written));
    rotation.add(0.5 * std::log(R_measured / R_written));
    double d_written = 0, d_measured = 0;
    for (int i = 0; i < rig.leds.size(); ++i) {
      for (int j = 0; j < i; ++j) {
        const double d = (truth.leds.p_BL(i) - truth.leds.p_BL(j)).norm();
        d_written += std::pow((rig.leds.p_BL(i) - rig.leds.p_BL(j)).norm() - d, 2);
        d_measured += std::pow((fit->leds.p_BL(i) - fit->leds.p_BL(j)).norm() - d, 2);
      }
    }
    constellation.add(0.5 * std::log(d_measured / d_written));
  }
  // Geometric means of the ratio, upper ends of 3 sd intervals.
  EXPECT_LT(position.value() + 3 * position.standard_error(), std::log(0.85));
  EXPECT_LT(rotation.value() + 3 * rotation.standard_error(), std::log(0.85));
  EXPECT_LT(constellation.value() + 3 * constellation.standard_error(), std::log(0.85));
}

/// Exact images of a drone at `X_NB`, as seen when it is expected at rest.
Result<RestFit> at(const Rig& rig, const Pose& X_NB,
                   const RestCalibrationConfig& config = {}) {
  Rng rng(1);
  return calibrate_at_rest(config, rig.camera, rig.leds,
                           images(rig.camera, rig.leds, X_NB, 0, rng),
                           expected_at_rest(rig));
}

// With mount and LEDs as uncertain as they are, 5 cm are five standard deviations of
// the height at which a rig makes a drone appear: told by the sum of squares, which is
// 0 for one that stands, but within what a bad rig may come to. Twice that is refused.
TEST(RestCalibration, RefusesADroneThatDoesNotStandOnThePad) {
  const Rig rig = alan_rig();
  const Pose rest = expected_at_rest(rig);
  RestCalibrationConfig open;
  open.chi2_max_per_led = 900;
  ASSERT_TRUE(at(rig, rest));
  for (unsigned seed = 0; seed < 200; ++seed) {
    Rng rng(seed);
    const double way = rng.uniform(0, 2 * kPi);
    const Matrix3 heading = from_rpy(0, 0, rng.normal(0, 5) * kDegree);
    const Vector3 beside(rng.normal(0, 0.03), rng.normal(0, 0.03), 0);
    const auto lifted = [&](double height) {
      return make_pose(heading,
                       rest.translation() + beside + height * Vector3::UnitZ());
    };
    const auto tilted = [&](double deg) {
      const Vector3 w = deg * kDegree * Vector3(std::cos(way), std::sin(way), 0);
      return make_pose(so3_exp(w) * heading, rest.translation() + beside);
    };
    for (const Pose& X_NB : {lifted(0.10), tilted(30)}) {
      const auto fit = at(rig, X_NB);
      ASSERT_FALSE(fit) << "seed " << seed << ", chi2 " << fit->chi2;
      EXPECT_EQ(fit.error().fault, Fault::degenerate);
    }
    for (const Pose& X_NB : {lifted(0.05), tilted(20)}) {
      const auto fit = at(rig, X_NB, open);
      ASSERT_TRUE(fit);
      EXPECT_GT(fit->chi2, 15) << "seed " << seed;
    }
  }
}

TEST(RestCalibration, RefusesSwappedLeds) {
  const Rig rig = alan_rig();
  Rng rng(1);
  const auto seen = images(rig.camera, rig.leds, expected_at_rest(rig), 0, rng);
  for (std::size_t i = 0; i < seen.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      auto swapped = seen;
      std::swap(swapped[i].uv, swapped[j].uv);
      const auto fit =
          calibrate_at_rest({}, rig.camera, rig.leds, swapped, expected_at_rest(rig));
      EXPECT_FALSE(fit) << "LEDs " << i << " and " << j << ", chi2 " << fit->chi2;
    }
  }
}

TEST(RestCalibration, RefusesTooLittleAndDamagedInput) {
  const Rig rig = alan_rig();
  const Pose rest = expected_at_rest(rig);
  Rng rng(1);
  const auto seen = images(rig.camera, rig.leds, rest, 0, rng);
  const auto fault_of = [&](const std::vector<LedObservation>& given) {
    const auto fit = calibrate_at_rest({}, rig.camera, rig.leds, given, rest);
    EXPECT_FALSE(fit);
    return fit ? Fault::io : fit.error().fault;
  };
  for (std::size_t n = 0; n < 4; ++n) {
    EXPECT_EQ(fault_of({seen.begin(), seen.begin() + static_cast<int>(n)}),
              Fault::too_few_points);
  }
  EXPECT_TRUE(
      calibrate_at_rest({}, rig.camera, rig.leds, std::span(seen).first(4), rest));
  for (std::size_t n = 0; n < seen.size(); ++n) {
    for (const double bad : {std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
      for (int axis = 0; axis < 2; ++axis) {
        auto damaged = seen;
        damaged[n].uv[axis] = bad;
        EXPECT_EQ(fault_of(damaged), Fault::too_few_points);
      }
    }
    for (const unsigned which : {0u, 1u << rig.leds.size(), 0x8001u}) {
      auto unknown = seen;
      unknown[n].leds = static_cast<std::uint16_t>(which);
      EXPECT_EQ(fault_of(unknown), Fault::too_few_points);
    }
  }
  // A place that is none is no place to measure at.
  Pose nowhere = rest;
  nowhere.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(calibrate_at_rest({}, rig.camera, rig.leds, seen, nowhere));
  // Nor is one behind the lens.
  Pose behind = rest;
  behind.translation().x() = 3;
  EXPECT_FALSE(calibrate_at_rest({}, rig.camera, rig.leds, seen, behind));
}

TEST(RestCalibrationConfig, NamesTheFieldThatIsOutOfBounds) {
  EXPECT_TRUE(RestCalibrationConfig{}.validate());
  const struct {
    const char* name;
    double RestCalibrationConfig::*field;
  } fields[] = {
      {"led_sd_m", &RestCalibrationConfig::led_sd_m},
      {"mount_position_sd_m", &RestCalibrationConfig::mount_position_sd_m},
      {"mount_rotation_sd_deg", &RestCalibrationConfig::mount_rotation_sd_deg},
      {"focal_sd_share", &RestCalibrationConfig::focal_sd_share},
      {"principal_sd_px", &RestCalibrationConfig::principal_sd_px},
      {"pixel_sd_px", &RestCalibrationConfig::pixel_sd_px},
      {"place_sd_m", &RestCalibrationConfig::place_sd_m},
      {"height_sd_m", &RestCalibrationConfig::height_sd_m},
      {"tilt_sd_deg", &RestCalibrationConfig::tilt_sd_deg},
      {"heading_sd_deg", &RestCalibrationConfig::heading_sd_deg},
      {"chi2_max_per_led", &RestCalibrationConfig::chi2_max_per_led}};
  for (const auto& f : fields) {
    for (const double bad : {0.0, -1.0, 1e4, std::numeric_limits<double>::quiet_NaN(),
                             std::numeric_limits<double>::infinity()}) {
      RestCalibrationConfig config;
      config.*f.field = bad;
      const auto valid = config.validate();
      ASSERT_FALSE(valid) << f.name << " = " << bad;
      EXPECT_EQ(valid.error().fault, Fault::invalid_config);
      EXPECT_NE(valid.error().detail.find(f.name), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace alight
