#pragma once
#include <gtest/gtest.h>

#include <cmath>

#include "alight/base/rng.h"
#include "alight/estimation/relative_filter.h"
#include "alight/geometry/flat_state.h"
#include "alight/geometry/rig.h"

namespace alight::test {

inline Vector3 normal3(Rng& rng, double sd) {
  return {rng.normal(0, sd), rng.normal(0, sd), rng.normal(0, sd)};
}

/// Pictures of a drone at X_NB by `leds` as they truly are, with pixel noise.
inline LedFrame picture(const Camera& camera, const Constellation& leds,
                        const Pose& X_NB, Time t, double sd_px, Rng& rng) {
  LedFrame frame;
  frame.t = t;
  for (int i = 0; i < leds.size(); ++i) {
    const auto uv = project_led(camera, X_NB, leds.p_BL(i));
    if (!uv || !camera.intrinsics.contains(*uv)) continue;
    frame.seen.push_back(
        {.leds = static_cast<std::uint16_t>(1u << i),
         .uv = *uv + Vector2(rng.normal(0, sd_px), rng.normal(0, sd_px)),
         .cov = sd_px * sd_px * Matrix2::Identity()});
  }
  return frame;
}

/// A platform on a circle and a drone that sways about a place behind it, tilting as
/// its thrust needs. Everything follows from the time.
struct Flight {
  double speed_m_s = 0.9;
  double radius_m = 1.5;
  Vector3 place_N{-0.85, 0, 0.6};  // 1.5 m from the lens
  Vector3 sway_m{0.15, 0.2, 0.1};
  double sway_hz = 0.3;

  PlatformState platform(double t) const {
    const double w = speed_m_s / radius_m;
    PlatformState p;
    p.t = from_seconds(t);
    p.X_IN = make_pose(from_rpy(0, 0, w * t + kPi / 2),
                       radius_m * Vector3(std::cos(w * t), std::sin(w * t), 0));
    p.v_IN_N = {speed_m_s, 0, 0};
    p.w_IN_N = {0, 0, w};
    p.a_IN_N = {0, w * speed_m_s, 0};
    return p;
  }

  FlatState flat(double t) const {
    FlatState s;
    for (int i = 0; i < 3; ++i) {
      const double w = 2 * kPi * sway_hz * (1 + 0.3 * i);
      s.p_NB[i] = place_N[i] + sway_m[i] * std::sin(w * t);
      s.v_NB[i] = sway_m[i] * w * std::cos(w * t);
      s.a_NB[i] = -sway_m[i] * w * w * std::sin(w * t);
    }
    return s;
  }

  /// Specific force in N if there were no wind.
  Vector3 force_N(double t) const {
    const FlatState s = flat(t);
    const PlatformState p = platform(t);
    return inertial_acceleration_N(p, s.p_NB, s.v_NB, s.a_NB) - gravity_N(p);
  }

  RelativeState state(double t) const {
    const FlatState s = flat(t);
    const Vector3 up = force_N(t).normalized();
    return {s.p_NB,
            Eigen::Quaterniond::FromTwoVectors(Vector3::UnitZ(), up).toRotationMatrix(),
            s.v_NB};
  }

  PredictionInput input(double t) const {
    const double h = 1e-3;
    PredictionInput u;
    u.platform = platform(t);
    u.f_N = force_N(t);
    u.w_NB_B = so3_log(state(t - h).R_NB.transpose() * state(t + h).R_NB) / (2 * h);
    return u;
  }
};

struct Errors {
  double position_rmse_m = 0;
  double rotation_rmse_deg = 0;
  double velocity_rmse_m_s = 0;
  double velocity_max_m_s = 0;
  double position_max_m = 0;
  double pose_nees = 0;  ///< mean, 6 degrees of freedom, against covariance()
  int failed = 0;        ///< updates
  int frames = 0;
  RelativeState last;
};

struct Conditions {
  double seconds = 10;
  double settle_s = 1;
  double sd_px = 0.2;
  double led_error_m = 0;
  double thrust_scale = 1;           ///< the filter is told this much of the force
  double rate_noise = 0.2;           ///< of the input, rad/s, drawn anew every 50 ms
  double force_noise = 0.3;          ///< of the input, m/s^2, drawn anew every 50 ms
  Vector3 gust_I = Vector3::Zero();  ///< on and off every two seconds
  std::uint64_t seed = 1;
};

inline Covariance9 start_covariance() {
  Covariance9 P = Covariance9::Identity();
  P.diagonal() << Vector3::Constant(4e-4), Vector3::Constant(4e-3),
      Vector3::Constant(0.1);
  return P;
}

/// `truth` moved on by the filter's own model, noise and all.
inline MotionState moved_by_model(const MotionState& truth,
                                  const PredictionInput& input, Seconds dt,
                                  const RelativeFilterConfig& config, Rng& rng) {
  const Matrix15 Q = process_covariance(config.noise, dt);
  Vector15 white;
  for (int i = 0; i < 15; ++i) white[i] = rng.normal();
  return boxplus(extrapolate(truth, input, dt, config.motion()),
                 Vector15(Q.llt().matrixL() * white));
}

/// Flies and filters; the truth never depends on the filter.
inline Errors fly(const Flight& flight, const RelativeFilterConfig& config,
                  const Conditions& c) {
  const Rig rig = alan_rig();
  Rng rng = Rng(c.seed).fork("picture"), input_rng = Rng(c.seed).fork("input");
  Constellation leds = rig.leds;
  for (int i = 0; i < leds.size(); ++i) {
    leds.leds[static_cast<std::size_t>(i)].p_BL += normal3(rng, c.led_error_m);
  }
  auto filter = RelativeFilter::create(config, rig.camera, rig.leds).value();
  Vector9 off;
  off << normal3(rng, 0.02), normal3(rng, 0.06), normal3(rng, 0.3);
  filter.reset(0, boxplus(flight.state(0), off), start_covariance());

  Errors e;
  int counted = 0;
  Vector3 w_error = Vector3::Zero(), f_error = Vector3::Zero();
  const int frames = static_cast<int>(c.seconds * 60);
  for (int k = 1; k <= frames; ++k) {
    const Time t = from_seconds(k / 60.0);
    const double middle = (k - 0.5) / 60;
    if (k % 3 == 1) {
      w_error = normal3(input_rng, c.rate_noise);
      f_error = normal3(input_rng, c.force_noise);
    }
    PredictionInput u = flight.input(middle);
    const bool gust = std::fmod(middle, 4.0) >= 2.0;
    if (gust) u.f_N -= u.platform.X_IN.linear().transpose() * c.gust_I;
    u.f_N = u.f_N * c.thrust_scale + f_error;
    u.w_NB_B += w_error;
    EXPECT_TRUE(filter.predict_to(t, u).has_value());
    const RelativeState truth = flight.state(to_seconds(t));
    const auto report =
        filter.update(picture(rig.camera, leds, truth.X_NB(), t, c.sd_px, rng));
    ++e.frames;
    if (!report) ++e.failed;
    if (to_seconds(t) < c.settle_s) continue;
    const Vector9 d = boxminus(filter.state(), truth);
    ++counted;
    e.position_rmse_m += d.head<3>().squaredNorm();
    e.rotation_rmse_deg += d.segment<3>(3).squaredNorm();
    e.velocity_rmse_m_s += d.tail<3>().squaredNorm();
    e.velocity_max_m_s = std::max(e.velocity_max_m_s, d.tail<3>().norm());
    e.position_max_m = std::max(e.position_max_m, d.head<3>().norm());
    const Eigen::Matrix<double, 6, 6> P = filter.covariance().topLeftCorner<6, 6>();
    e.pose_nees += d.head<6>().dot(P.llt().solve(d.head<6>()));
  }
  e.position_rmse_m = std::sqrt(e.position_rmse_m / counted);
  e.rotation_rmse_deg = std::sqrt(e.rotation_rmse_deg / counted) / kDegree;
  e.velocity_rmse_m_s = std::sqrt(e.velocity_rmse_m_s / counted);
  e.pose_nees /= counted;
  e.last = filter.state();
  return e;
}

}  // namespace alight::test
