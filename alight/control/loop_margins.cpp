#include "alight/control/loop_margins.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace alight {
namespace {

using Complex = std::complex<double>;
using ComplexVector = Eigen::Matrix<Complex, 3, 1>;
using ComplexMatrix = Eigen::Matrix<Complex, 3, 3>;

Matrix3 transition(Seconds dt) {
  Matrix3 F;
  F << 1, dt, 0.5 * dt * dt, 0, 1, dt, 0, 0, 1;
  return F;
}

/// What the state gains from an acceleration signal of unit amplitude over the last
/// `T`.
ComplexVector gained(Complex s, Seconds T) {
  const Complex decay = std::exp(-s * T);
  return {(1.0 - decay) / (s * s) - T * decay / s, (1.0 - decay) / s, 0};
}

constexpr double kLowest = 0.02;  // rad/s
constexpr double kHighest = 200;
constexpr int kPoints = 1500;

double frequency(int i) {
  return kLowest * std::pow(kHighest / kLowest, static_cast<double>(i) / (kPoints - 1));
}

double unwrapped(double previous, double angle) {
  return previous + wrap_angle(angle - previous);
}

/// Turn of 1 + L from the lowest to the highest frequency.
template <class OpenLoop>
double turn(const OpenLoop& L) {
  double angle = std::arg(1.0 + L(kLowest));
  const double begin = angle;
  for (int i = 1; i < kPoints; ++i) {
    angle = unwrapped(angle, std::arg(1.0 + L(frequency(i))));
  }
  return angle - begin;
}

}  // namespace

Loop::Loop(const LoopModel& model) : model_(model) {
  const double dead = model.axis == LoopModel::Axis::horizontal
                          ? model.response.delay_ms
                          : model.response.thrust_delay_ms;
  horizon_ =
      model.camera_delay + 0.5 * model.frame_period + model.link_delay + dead * 1e-3;

  const Seconds T = model.frame_period;
  const Matrix3 F = transition(T);
  const double qa = model.acceleration_noise * model.acceleration_noise;
  const double qd = model.disturbance_noise * model.disturbance_noise;
  const double T2 = T * T, T3 = T2 * T;
  Matrix3 Q;
  Q << T3 / 3, T2 / 2, 0, T2 / 2, T, 0, 0, 0, 0;
  Q *= qa;
  Matrix3 Qd;
  Qd << T2 * T3 / 20, T2 * T2 / 8, T3 / 6, T2 * T2 / 8, T3 / 3, T2 / 2, T3 / 6, T2 / 2,
      T;
  Q += qd * Qd;
  const double r = model.position_sd_m * model.position_sd_m;
  Matrix3 P = Matrix3::Identity();
  for (int i = 0; i < 4000; ++i) {
    P = F * P * F.transpose() + Q;
    const Vector3 K = P.col(0) / (P(0, 0) + r);
    P = (P - K * P.row(0)).eval();
    P = (0.5 * (P + P.transpose())).eval();
    const double change = (K - kalman_).norm();
    kalman_ = K;
    if (change < 1e-14 * K.norm()) break;
  }
}

Complex Loop::lag(Complex s, double omega_scale) const {
  const DroneResponseConfig& r = model_.response;
  if (model_.axis == LoopModel::Axis::vertical) {
    return 1.0 / (1.0 + s * (r.motor_ms * 1e-3 / omega_scale));
  }
  const double w0 = r.omega_rad_s * omega_scale;
  return w0 * w0 / (s * s + 2 * r.zeta * w0 * s + w0 * w0);
}

// All signals stand on the axis of the time at which set-points take effect.
Complex Loop::open_loop(double w, const LoopError& error) const {
  const Complex s(0, w);
  const Seconds T = model_.frame_period, Tc = model_.control_period;
  const Complex hold = (1.0 - std::exp(-s * Tc)) / (s * Tc);
  const bool vertical = model_.axis == LoopModel::Axis::vertical;
  const AttitudeControllerConfig& g = model_.gains;
  const double ka = vertical ? g.ka_z : g.ka;
  // The disturbance takes part twice: in the force wished, and in its difference from
  // the modelled one.
  const Complex kd = (1 + ka) / (1.0 + s * g.disturbance_lag_s);
  const Eigen::RowVector3cd k = vertical ? Eigen::RowVector3cd(g.kp_z, g.kv_z, kd)
                                         : Eigen::RowVector3cd(g.kp, g.kv, kd);

  // Filter, at the time of the picture: x = from_a a_model + from_y y.
  Matrix3 keep = Matrix3::Identity();
  keep.col(0) -= kalman_;
  const ComplexMatrix M = ComplexMatrix::Identity() -
                          (keep * transition(T)).cast<Complex>() * std::exp(-s * T);
  const ComplexMatrix inverse = M.inverse();
  const ComplexVector from_y = inverse * kalman_.cast<Complex>();
  const ComplexVector from_a = inverse * (keep.cast<Complex>() * gained(s, T));

  // Carried forward by the horizon.
  const ComplexMatrix forward =
      transition(horizon_).cast<Complex>() * std::exp(-s * horizon_);
  const Complex by_y = (k * (forward * from_y)).value();
  const Complex by_a = (k * (forward * from_a + gained(s, horizon_))).value() + ka;
  const Complex inner = by_a * lag(s, 1) * hold;
  const Complex plant = error.thrust_scale * lag(s, error.omega_scale) * hold *
                        std::exp(-s * error.extra_delay) / (s * s);
  return plant * by_y / (1.0 + inner);
}

LoopMargins Loop::margins(const LoopError& error) const {
  const auto L = [&](double w) { return open_loop(w, error); };
  LoopMargins m;
  m.stable = std::abs(turn(L) - turn([&](double w) { return open_loop(w); })) < kPi;
  m.phase_deg = 180;
  m.delay_ms = m.gain_up_db = m.gain_down_db = 1e9;
  Complex before = L(kLowest);
  for (int i = 1; i < kPoints; ++i) {
    const double w = frequency(i);
    const Complex now = L(w);
    m.sensitivity_peak = std::max(m.sensitivity_peak, 1 / std::abs(1.0 + now));
    if ((std::abs(before) > 1) != (std::abs(now) > 1)) {
      // Angle by which L may still turn clockwise, and either way, to reach -1.
      const double behind = std::fmod(std::arg(now) + 3 * kPi, 2 * kPi);
      m.phase_deg = std::min(m.phase_deg, std::min(behind, 2 * kPi - behind) / kDegree);
      m.delay_ms = std::min(m.delay_ms, 1e3 * behind / w);
      m.crossover_rad_s = w;
    }
    if (before.imag() * now.imag() < 0 && now.real() < 0) {
      const double db = -20 * std::log10(std::abs(now));
      if (db > 0) m.gain_up_db = std::min(m.gain_up_db, db);
      if (db < 0) m.gain_down_db = std::min(m.gain_down_db, -db);
    }
    before = now;
  }
  return m;
}

Complex Loop::from_disturbance(double w, const LoopError& error) const {
  return -1.0 / (w * w) / (1.0 + open_loop(w, error));
}

LoopErrors Loop::errors(const GustModel& gust, const LoopError& error) const {
  LoopErrors e;
  double gust_variance = 0, noise_variance = 0;
  const double corner = gust.airspeed_m_s / gust.length_m;
  const double noise_density =
      model_.position_sd_m * model_.position_sd_m * model_.frame_period / kPi;
  // The step's response by its sine transform: p(t) = 2/pi int Re(P(w) / jw) cos(wt)
  // dw.
  constexpr int kTimes = 150;
  constexpr Seconds kTimeStep = 0.02;
  std::vector<double> step(kTimes, 0);
  for (int i = 1; i < kPoints; ++i) {
    const double w0 = frequency(i - 1), w1 = frequency(i);
    const double w = 0.5 * (w0 + w1), dw = w1 - w0;
    const Complex P = from_disturbance(w, error);
    const double S_gust = 2 * gust.sd_m_s * gust.sd_m_s / (kPi * corner) /
                          (1 + (w / corner) * (w / corner));
    gust_variance += std::norm(P) * gust.drag_per_s * gust.drag_per_s * S_gust * dw;
    const Complex L = open_loop(w, error);
    noise_variance += std::norm(L / (1.0 + L)) * noise_density * dw;
    const double re = (P / Complex(0, w)).real();
    for (int j = 0; j < kTimes; ++j) {
      step[static_cast<std::size_t>(j)] +=
          2 / kPi * re * std::cos(w * kTimeStep * j) * dw;
    }
  }
  e.gust_m = std::sqrt(gust_variance);
  e.noise_m = std::sqrt(noise_variance);
  for (const double p : step) {
    e.step_peak_m_per_m_s2 = std::max(e.step_peak_m_per_m_s2, std::abs(p));
  }
  return e;
}

}  // namespace alight
