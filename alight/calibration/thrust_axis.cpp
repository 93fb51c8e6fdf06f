#include "alight/calibration/thrust_axis.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "alight/geometry/platform_state.h"
#include "alight/geometry/so3.h"

namespace alight {
namespace {

constexpr Seconds kGap = 0.1;      // between two pictures of a stretch
constexpr double kReaches = 0.7;   // of half a stretch, on both sides of its middle
constexpr double kModelSd = 0.03;  // m/s^2, of what the model leaves out

/// A stretch of flight, as it was on the mean about its middle.
struct Stretch {
  Vector3 v_NB, a_NB;
  Matrix3 R_NB;
  double a_variance;
};

std::optional<Stretch> stretch_of(const ThrustAxisConfig& config,
                                  std::span<const ObservedFrame> frames, Time middle) {
  const Seconds half = 0.5 * config.window_s;
  const auto n = static_cast<Eigen::Index>(frames.size());
  if (n < config.poses_min) return std::nullopt;
  Eigen::MatrixXd X(n, 3), p(n, 3);
  Seconds before = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const ObservedFrame& frame = frames[static_cast<std::size_t>(i)];
    const Seconds t = to_seconds(frame.t - middle);
    if (i > 0 && t - before > kGap) return std::nullopt;
    before = t;
    X.row(i) << 1, t, 0.5 * t * t;
    p.row(i) = frame.X_NB.translation();
  }
  if (X(0, 1) > -kReaches * half || X(n - 1, 1) < kReaches * half) return std::nullopt;
  const Eigen::Matrix3d cov = (X.transpose() * X).inverse();
  const Eigen::MatrixXd c = cov * X.transpose() * p;
  if (!c.allFinite()) return std::nullopt;
  Stretch out;
  out.v_NB = c.row(1);
  out.a_NB = c.row(2);
  const double freedom = 3.0 * static_cast<double>(n - 3);
  out.a_variance = (p - X * c).squaredNorm() / freedom * cov(2, 2);
  // The second derivative of a parabola's fit weighs accelerations so, and so must
  // attitudes be weighed that are held against it.
  const Matrix3 R_0 = frames[frames.size() / 2].X_NB.linear();
  Vector3 turn = Vector3::Zero();
  double sum = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double u = std::min(1.0, std::abs(X(i, 1)) / half);
    const double w = (1 - u * u) * (1 - u * u);
    const Matrix3 R = frames[static_cast<std::size_t>(i)].X_NB.linear();
    turn += w * so3_log(R_0.transpose() * R);
    sum += w;
  }
  out.R_NB = R_0 * so3_exp(turn / sum);
  return out;
}

std::vector<Stretch> stretches_of(const ThrustAxisConfig& config,
                                  std::span<const ObservedFrame> frames) {
  std::vector<Stretch> out;
  const Time length = from_seconds(config.window_s);
  std::size_t begin = 0;
  while (begin < frames.size()) {
    const Time from = frames[begin].t;
    std::size_t end = begin;
    while (end < frames.size() && frames[end].t - from <= length) ++end;
    const auto found =
        stretch_of(config, frames.subspan(begin, end - begin), from + length / 2);
    if (found) {
      out.push_back(*found);
      begin = end;  // none shares pictures with another
    } else {
      ++begin;
    }
  }
  return out;
}

}  // namespace

Result<ThrustAxis> find_thrust_axis(const ThrustAxisConfig& config,
                                    std::span<const ObservedFrame> frames) {
  const std::vector<Stretch> all = stretches_of(config, frames);
  const auto n = static_cast<Eigen::Index>(all.size());
  if (n < config.windows_min) {
    return fail(Fault::too_few_points,
                "only " + std::to_string(n) +
                    " of the stretches of flight in which the "
                    "LEDs are followed from picture to picture, " +
                    std::to_string(config.windows_min) +
                    " are needed: record ten seconds of flight within 1.5 m");
  }
  // Of the specific force across z of B: s u - d v_B + R_BN n, with s the thrust, u
  // where it points, d the drag and n a steady push in N.
  constexpr int kUnknowns = 5;
  Eigen::MatrixXd A(2 * n, kUnknowns);
  Eigen::VectorXd b(2 * n), w(2 * n);
  Vector2 a_mean = Vector2::Zero();
  double w_sum = 0;
  for (Eigen::Index k = 0; k < n; ++k) {
    const Stretch& s = all[static_cast<std::size_t>(k)];
    const Matrix3 R_BN = s.R_NB.transpose();
    const Vector3 f_B = R_BN * (s.a_NB + Vector3(0, 0, kGravity));
    const Vector3 v_B = R_BN * s.v_NB;
    A.row(2 * k) << f_B.z(), 0, -v_B.x(), R_BN(0, 0), R_BN(0, 1);
    A.row(2 * k + 1) << 0, f_B.z(), -v_B.y(), R_BN(1, 0), R_BN(1, 1);
    b.segment<2>(2 * k) = f_B.head<2>();
    const double weight = 1 / (s.a_variance + kModelSd * kModelSd);
    w.segment<2>(2 * k).setConstant(weight);
    a_mean += weight * s.a_NB.head<2>();
    w_sum += weight;
  }
  a_mean /= w_sum;
  Eigen::Matrix<double, kUnknowns, 1> known;
  const auto inverse_square = [](double sd) { return 1 / (sd * sd); };
  known << 0, 0, inverse_square(config.drag_sd_per_s),
      inverse_square(config.push_sd_m_s2), inverse_square(config.push_sd_m_s2);
  Eigen::Matrix<double, kUnknowns, kUnknowns> S = A.transpose() * w.asDiagonal() * A;
  S.diagonal() += known;
  const Eigen::LDLT<Eigen::Matrix<double, kUnknowns, kUnknowns>> solver(S);
  const Eigen::VectorXd x = solver.solve(A.transpose() * w.cwiseProduct(b));
  const Eigen::VectorXd left = b - A * x;
  double moves = 0;
  for (Eigen::Index k = 0; k < n; ++k) {
    moves += w(2 * k) *
             (all[static_cast<std::size_t>(k)].a_NB.head<2>() - a_mean).squaredNorm();
  }
  const double missed = left.cwiseAbs2().dot(w);
  ThrustAxis out;
  out.windows = static_cast<int>(n);
  out.follows = moves > 0 ? 1 - missed / moves : 0;
  const double rms = std::sqrt(moves / w_sum / 2);
  if (!x.allFinite() || !(rms >= config.moves_min_m_s2) ||
      !(out.follows >= config.follows_min)) {
    return fail(Fault::degenerate,
                !(rms >= config.moves_min_m_s2)
                    ? "the drone hardly accelerates: fly to and fro, too"
                    : "its attitude does not go with its acceleration: is it carried "
                      "by hand, or does the platform move?");
  }
  const double freedom = static_cast<double>(2 * n - kUnknowns);
  const double larger = std::max(1.0, missed / freedom);
  const Eigen::Matrix<double, kUnknowns, kUnknowns> cov =
      larger *
      solver.solve(Eigen::Matrix<double, kUnknowns, kUnknowns>::Identity().eval());
  // exp(turn) u is to be z.
  Eigen::Matrix2d turn;
  turn << 0, 1, -1, 0;
  out.turn_rad = turn * x.head<2>();
  out.cov = turn * cov.topLeftCorner<2, 2>() * turn.transpose();
  const double least = config.sd_min_deg * kDegree;
  out.cov.diagonal().array() += least * least;
  return out;
}

}  // namespace alight
