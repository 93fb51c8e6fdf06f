#pragma once
#include <cmath>

#include "alight/base/rng.h"
#include "alight/control/attitude_controller.h"
#include "alight/control/loop_margins.h"

namespace alight {

/// A small world for the controller alone: point mass behind a second DroneResponse
/// with its own errors and air resistance, a camera that sees positions late, a linear
/// steady-state filter that predicts with the controller's air resistance.
struct AttitudeLoop {
  LoopModel model;  ///< gains, delays, filter
  LoopError error;  ///< how the drone differs
  DroneResponseConfig believed;
  double speed_m_s = 0;  ///< of the platform on a circle
  double radius_m = 1.5;
  Vector3 disturbance_I = Vector3::Zero();  ///< m/s^2, from `disturbance_from` on
  Seconds disturbance_from = 0;
  double position_noise_m = 0;
  double velocity_noise_m_s = 0;  ///< on what the controller is handed
  double autopilot_heading = 0;
  double drag_per_s = 0.35;  ///< The world's; the filter believes the controller's.
  double filter_sd_m = 0.005;
  bool poison = false;  ///< Every 7th step's input is NaN.
  std::uint64_t seed = 1;

  struct Result {
    double rms_m = 0;       ///< after `settle`
    double last_rms_m = 0;  ///< over the last second
    double peak_m = 0;
    Vector3 mean_m = Vector3::Zero();
    int limited = 0;
  };

  PlatformState platform(Time t) const {
    PlatformState s;
    s.t = t;
    const double w = speed_m_s / radius_m, a = w * to_seconds(t);
    s.X_IN = make_pose(from_rpy(0, 0, a), Vector3(radius_m * std::sin(a),
                                                  radius_m * (1 - std::cos(a)), 0));
    s.v_IN_N = Vector3(speed_m_s, 0, 0);
    s.w_IN_N = Vector3(0, 0, w);
    s.a_IN_N = Vector3(0, w * speed_m_s, 0);
    return s;
  }

  Result run(Seconds duration, Seconds settle) const {
    LoopModel m = model;
    m.position_sd_m = filter_sd_m;
    const Vector3 K = Loop(m).filter_gain();
    auto controller =
        AttitudeController::create(m.gains, believed, DroneSpec{}).value();
    DroneResponseConfig real = believed;
    real.omega_rad_s *= error.omega_scale;
    real.motor_ms /= error.omega_scale;
    real.thrust_to_weight *= error.thrust_scale;
    DroneResponse drone(real), response(believed);

    FlatState reference;
    reference.p_NB = Vector3(-1.2, 0, 0.5);
    const Matrix3 R_AI = from_rpy(0, 0, autopilot_heading);
    const PlatformState begin = platform(0);
    Vector3 p = begin.X_IN * reference.p_NB;
    Vector3 v = begin.X_IN.linear() *
                inertial_velocity_N(begin, reference.p_NB, Vector3::Zero());
    drone.reset(0, R_AI * begin.X_IN.linear());
    response.reset(0, R_AI * begin.X_IN.linear());

    // Filter in I, at the time of the last picture.
    Vector3 fp = p, fv = v, fd = Vector3::Zero();
    Time ft = 0;
    const auto carry = [&](Vector3& x, Vector3& xv, const Vector3& d, Time from,
                           Time to) {
      for (Time t = from; t < to;) {
        const Time next = std::min(to, t + DroneResponse::kGrid);
        const Seconds dt = to_seconds(next - t);
        const Vector3 a = R_AI.transpose() * response.at((t + next) / 2).f_I() + d -
                          m.gains.drag_per_s * xv - Vector3(0, 0, kGravity);
        x += dt * xv + 0.5 * dt * dt * a;
        xv += dt * a;
        t = next;
      }
    };

    Rng rng(seed);
    const Time period = from_seconds(m.control_period);
    const Time frame = from_seconds(m.frame_period);
    const Time link = from_seconds(m.link_delay);
    const Time lead = link + from_seconds(believed.delay_ms * 1e-3);
    FixedVector<std::pair<Time, Vector3>, 16> pictures;
    Time next_picture = 0;
    Result r;
    int n = 0, last_n = 0, step = 0;
    double sum = 0, last_sum = 0;
    for (Time now = 0; now < from_seconds(duration); now += period) {
      while (!pictures.empty() &&
             pictures[0].first + from_seconds(m.camera_delay) <= now) {
        carry(fp, fv, fd, ft, pictures[0].first);
        ft = pictures[0].first;
        const Vector3 innovation = pictures[0].second - fp;
        fp += K[0] * innovation;
        fv += K[1] * innovation;
        fd += K[2] * innovation;
        pictures.erase(0);
      }

      const Time effect = now + lead;
      response.advance(effect);
      Vector3 xp = fp, xv = fv;
      carry(xp, xv, fd, ft, effect);
      for (int i = 0; i < 3; ++i) xv[i] += rng.normal(0, velocity_noise_m_s);

      AttitudeInput in;
      in.platform = platform(effect);
      in.platform_later = platform(effect + from_seconds(AttitudeInput::kLater));
      const Matrix3 R_NI = in.platform.X_IN.linear().transpose();
      in.state.p_NB = in.platform.X_IN.inverse() * xp;
      in.state.v_NB =
          R_NI * xv - in.platform.v_IN_N - in.platform.w_IN_N.cross(in.state.p_NB);
      in.response = response.at(effect);
      in.autopilot_heading = autopilot_heading;
      in.d_N = R_NI * fd;
      in.reference = reference;
      if (poison && ++step % 7 == 0) in.state.p_NB.y() = std::nan("");
      const AttitudeOutput out = controller.step(in, m.control_period);
      if (out.limited) ++r.limited;
      response.sent(out.setpoint, now + link);
      drone.sent(out.setpoint, now + link + from_seconds(error.extra_delay));

      // The world to the next step, 1 ms at a time.
      drone.advance(now + period);
      for (Time t = now; t < now + period; t += 1'000'000) {
        if (t >= next_picture) {
          Vector3 seen = p;
          for (int i = 0; i < 3; ++i) seen[i] += rng.normal(0, position_noise_m);
          pictures.push_back({t, seen});
          next_picture += frame;
        }
        const Vector3 d =
            to_seconds(t) >= disturbance_from ? disturbance_I : Vector3::Zero();
        const Vector3 a = R_AI.transpose() * drone.at(t + 500'000).f_I() + d -
                          drag_per_s * v - Vector3(0, 0, kGravity);
        p += 1e-3 * v + 0.5e-6 * a;
        v += 1e-3 * a;
      }
      const Vector3 e = platform(now + period).X_IN.inverse() * p - reference.p_NB;
      if (to_seconds(now) >= settle) {
        sum += e.squaredNorm();
        r.mean_m += e;
        ++n;
        r.peak_m = std::max(r.peak_m, e.norm());
      }
      if (to_seconds(now) >= duration - 1) {
        last_sum += e.squaredNorm();
        ++last_n;
      }
      if (!(e.norm() < 100)) {
        r.rms_m = r.last_rms_m = r.peak_m = 1e9;
        return r;
      }
    }
    r.rms_m = std::sqrt(sum / n);
    r.last_rms_m = std::sqrt(last_sum / last_n);
    r.mean_m /= n;
    return r;
  }
};

}  // namespace alight
