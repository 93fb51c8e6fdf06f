#include "alight/calibration/led_adjustment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "alight/base/median.h"

namespace alight {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using RowsX6 = Eigen::Matrix<double, Eigen::Dynamic, 6>;

constexpr int kRounds = 4;             // of scale and outliers
constexpr int kSteps = 60;             // of one round
constexpr double kMedianChi2 = 1.386;  // of two degrees of freedom
constexpr int kBlocks = 24;            // of successive frames whose errors go together
constexpr double kRejectMost = 1e4;

struct State {
  Constellation leds;
  std::vector<Pose> poses;
  double depth_scale = 1;
};

/// Residual of one observation, prediction minus picture, and its derivatives.
struct Term {
  Vector2 r;
  Matrix26 by_pose;
  Eigen::Matrix<double, 2, Eigen::Dynamic> by_led;  // 2 x 3 m, m LEDs of the blob
  double r_depth = 0;
  Eigen::Matrix<double, 1, 6> depth_by_pose;
  Eigen::Matrix<double, 1, Eigen::Dynamic> depth_by_led;
  double depth_by_scale = 0;
};

bool evaluate(const Camera& camera, const State& x, const Pose& X_NB,
              const LedObservation& o, Term& term) {
  const int m = std::popcount(o.leds);
  const double share = 1.0 / m;
  const Matrix3 R_CN = camera.X_NC.linear().transpose();
  const Matrix3 R_CB = R_CN * X_NB.linear();
  term.r = -o.uv;
  term.by_pose.setZero();
  term.by_led.resize(2, 3 * m);
  term.depth_by_pose.setZero();
  term.depth_by_led.resize(1, 3 * m);
  double z = 0;
  int k = 0;
  for (int i = 0; i < x.leds.size(); ++i) {
    if (((o.leds >> i) & 1) == 0) continue;
    const Vector3& p_BL = x.leds.p_BL(i);
    const Vector3 p_CL = R_CN * (X_NB * p_BL - camera.X_NC.translation());
    Matrix23 by_p;
    const auto uv = camera.intrinsics.project(p_CL, by_p);
    if (!uv) return false;
    term.r += share * *uv;
    const Matrix3 turn = -R_CB * hat(p_BL);
    term.by_pose.leftCols<3>() += share * by_p * R_CN;
    term.by_pose.rightCols<3>() += share * by_p * turn;
    term.by_led.middleCols<3>(3 * k) = share * by_p * R_CB;
    z += share * p_CL.z();
    term.depth_by_pose.head<3>() += share * x.depth_scale * R_CN.row(2);
    term.depth_by_pose.tail<3>() += share * x.depth_scale * turn.row(2);
    term.depth_by_led.segment<3>(3 * k) = share * x.depth_scale * R_CB.row(2);
    ++k;
  }
  term.r_depth = x.depth_scale * z - o.depth_m;
  term.depth_by_scale = z;
  return true;
}

class Adjuster {
 public:
  Adjuster(const LedAdjustmentConfig& config, const Camera& camera,
           const Constellation& nominal, std::span<const ObservedFrame> frames)
      : config_(config),
        camera_(camera),
        nominal_(nominal),
        frames_(frames),
        leds_(3 * nominal.size()),
        unknowns_(leds_ + 1) {
    for (const ObservedFrame& frame : frames) {
      rejected_.emplace_back(frame.seen.size(), false);
    }
  }

  Result<LedAdjustment> run(const Constellation& start) {
    State x{start, {}, 1};
    for (const ObservedFrame& frame : frames_) x.poses.push_back(frame.X_NB);
    for (int round = 0; round < kRounds; ++round) {
      if (!minimize(x)) return fail(Fault::no_convergence);
      if (!judge(x, round + 1 < kRounds)) return fail(Fault::too_few_points);
    }
    return report(x);
  }

 private:
  Matrix2 weight(const LedObservation& o) const {
    const double own = config_.pixel_sd_px * config_.pixel_sd_px;
    return (o.cov + own * Matrix2::Identity()).inverse() / (scale_ * scale_);
  }
  double depth_sd(const LedObservation& o) const {
    return config_.depth_sd_m + config_.depth_sd_share * o.depth_m;
  }
  bool has_depth(const LedObservation& o) const {
    return config_.use_depth && o.depth_m > 0;
  }
  /// Huber's cost of a squared, weighted residual, and its weight.
  double cost_of(double e2, double& w) const {
    const double k = config_.huber_sd;
    if (e2 <= k * k) {
      w = 1;
      return e2;
    }
    const double e = std::sqrt(e2);
    w = k / e;
    return 2 * k * e - k * k;
  }

  /// What one frame adds: by LEDs, by pose and by both.
  struct FrameNormal {
    Matrix6 A = Matrix6::Zero();
    Vector6 b = Vector6::Zero();
    RowsX6 C;
  };

  /// Cost at `x`; when `S` is given also the normal equations with `damping` on the
  /// poses, poses eliminated. `frame_score`, when given, gets each frame's gradient,
  /// `by_bias` the gradient's derivative by a shift of each LED's images.
  double linearize(const State& x, MatrixXd* S, VectorXd* g, double damping,
                   std::vector<FrameNormal>* normals, MatrixXd* frame_score = nullptr,
                   MatrixXd* by_bias = nullptr) const {
    double cost = 0;
    if (S != nullptr) {
      S->setZero(unknowns_, unknowns_);
      g->setZero(unknowns_);
      normals->assign(frames_.size(), {});
    }
    if (frame_score != nullptr) {
      frame_score->setZero(unknowns_, static_cast<Eigen::Index>(frames_.size()));
    }
    if (by_bias != nullptr) by_bias->setZero(unknowns_, 2 * x.leds.size());
    Term term;
    MatrixXd pose_bias;
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      if (by_bias != nullptr) pose_bias.setZero(6, by_bias->cols());
      FrameNormal normal;
      normal.C = RowsX6::Zero(unknowns_, 6);
      VectorXd score = VectorXd::Zero(unknowns_);
      for (std::size_t k = 0; k < frames_[f].seen.size(); ++k) {
        const LedObservation& o = frames_[f].seen[k];
        if (rejected_[f][k]) continue;
        if (!evaluate(camera_, x, x.poses[f], o, term)) {
          return std::numeric_limits<double>::infinity();
        }
        const Matrix2 W0 = weight(o);
        double w = 1;
        cost += cost_of(term.r.dot(W0 * term.r), w);
        double w_depth = 0;
        if (has_depth(o)) {
          const double sd = depth_sd(o);
          cost += cost_of(term.r_depth * term.r_depth / (sd * sd), w_depth);
          w_depth /= sd * sd;
        }
        if (S == nullptr) continue;
        const Matrix2 W = w * W0;
        normal.A += term.by_pose.transpose() * W * term.by_pose;
        normal.b -= term.by_pose.transpose() * W * term.r;
        if (w_depth > 0) {
          normal.A += w_depth * term.depth_by_pose.transpose() * term.depth_by_pose;
          normal.b -= w_depth * term.r_depth * term.depth_by_pose.transpose();
          const double s = w_depth * term.depth_by_scale;
          (*S)(leds_, leds_) += s * term.depth_by_scale;
          score(leds_) -= s * term.r_depth;
          normal.C.row(leds_) += s * term.depth_by_pose;
        }
        int a = 0;
        for (int i = 0; i < x.leds.size(); ++i) {
          if (((o.leds >> i) & 1) == 0) continue;
          const auto Ji = term.by_led.middleCols<3>(3 * a);
          const auto Di = term.depth_by_led.segment<3>(3 * a);
          ++a;
          score.segment<3>(3 * i) -= Ji.transpose() * W * term.r;
          if (by_bias != nullptr) {
            const double share = 1.0 / std::popcount(o.leds);
            pose_bias.middleCols<2>(2 * i) += share * term.by_pose.transpose() * W;
            for (int j = 0, c = 0; j < x.leds.size(); ++j) {
              if (((o.leds >> j) & 1) == 0) continue;
              by_bias->block<3, 2>(3 * j, 2 * i) +=
                  share * term.by_led.middleCols<3>(3 * c++).transpose() * W;
            }
          }
          normal.C.middleRows<3>(3 * i) += Ji.transpose() * W * term.by_pose;
          if (w_depth > 0) {
            score.segment<3>(3 * i) -= w_depth * term.r_depth * Di.transpose();
            normal.C.middleRows<3>(3 * i) +=
                w_depth * Di.transpose() * term.depth_by_pose;
            const Vector3 cross = w_depth * term.depth_by_scale * Di.transpose();
            S->block<3, 1>(3 * i, leds_) += cross;
            S->block<1, 3>(leds_, 3 * i) += cross.transpose();
          }
          int c = 0;
          for (int j = 0; j < x.leds.size(); ++j) {
            if (((o.leds >> j) & 1) == 0) continue;
            const auto Jj = term.by_led.middleCols<3>(3 * c);
            const auto Dj = term.depth_by_led.segment<3>(3 * c);
            ++c;
            S->block<3, 3>(3 * i, 3 * j) += Ji.transpose() * W * Jj;
            if (w_depth > 0)
              S->block<3, 3>(3 * i, 3 * j) += w_depth * Di.transpose() * Dj;
          }
        }
      }
      if (S == nullptr) continue;
      normal.A.diagonal() *= 1 + damping;
      normal.A.diagonal().array() += 1e-9;
      const Eigen::LDLT<Matrix6> pose(normal.A);
      const Eigen::Matrix<double, 6, Eigen::Dynamic> by_pose =
          pose.solve(normal.C.transpose());
      *S -= normal.C * by_pose;
      score -= by_pose.transpose() * normal.b;
      *g += score;
      if (by_bias != nullptr) *by_bias -= by_pose.transpose() * pose_bias;
      if (frame_score != nullptr)
        frame_score->col(static_cast<Eigen::Index>(f)) = score;
      (*normals)[f] = std::move(normal);
    }
    return cost;
  }

  /// Cost of what is known without pictures, added to the normal equations.
  double prior(const State& x, MatrixXd* S, VectorXd* g) const {
    const double w = 1 / (config_.led_sd_m * config_.led_sd_m);
    double cost = 0;
    for (int i = 0; i < x.leds.size(); ++i) {
      const Vector3 d = x.leds.p_BL(i) - nominal_.p_BL(i);
      cost += w * d.squaredNorm();
      if (S == nullptr) continue;
      S->block<3, 3>(3 * i, 3 * i).diagonal().array() += w;
      g->segment<3>(3 * i) -= w * d;
    }
    for (const LedDistance& known : config_.distances) {
      const Vector3 apart = x.leds.p_BL(known.i) - x.leds.p_BL(known.j);
      const double length = std::max(apart.norm(), 1e-9);
      const double r = length - known.distance_m;
      const double w_known = 1 / (known.sd_m * known.sd_m);
      cost += w_known * r * r;
      if (S == nullptr) continue;
      VectorXd J = VectorXd::Zero(unknowns_);
      J.segment<3>(3 * known.i) = apart / length;
      J.segment<3>(3 * known.j) = -apart / length;
      *S += w_known * J * J.transpose();
      *g -= w_known * r * J;
    }
    const double w_scale =
        1 / (config_.depth_scale_sd_share * config_.depth_scale_sd_share);
    cost += w_scale * (x.depth_scale - 1) * (x.depth_scale - 1);
    if (S != nullptr) {
      (*S)(leds_, leds_) += w_scale;
      (*g)(leds_) -= w_scale * (x.depth_scale - 1);
    }
    return cost;
  }

  bool minimize(State& x) const {
    double damping = 1e-6;
    double cost =
        linearize(x, nullptr, nullptr, 0, nullptr) + prior(x, nullptr, nullptr);
    if (!std::isfinite(cost)) return false;
    MatrixXd S;
    VectorXd g;
    std::vector<FrameNormal> normals;
    for (int step = 0; step < kSteps && damping < 1e8; ++step) {
      linearize(x, &S, &g, damping, &normals);
      prior(x, &S, &g);
      S.diagonal() *= 1 + damping;
      const VectorXd d = S.ldlt().solve(g);
      if (!d.allFinite()) return false;
      State next = x;
      for (int i = 0; i < x.leds.size(); ++i) {
        next.leds.leds[static_cast<std::size_t>(i)].p_BL += d.segment<3>(3 * i);
      }
      next.depth_scale += d(leds_);
      double moved = d.head(leds_).cwiseAbs().maxCoeff();
      for (std::size_t f = 0; f < frames_.size(); ++f) {
        const FrameNormal& n = normals[f];
        const Vector6 e = n.A.ldlt().solve(n.b - n.C.transpose() * d);
        next.poses[f].translation() += e.head<3>();
        next.poses[f].linear() =
            orthonormalized(x.poses[f].linear() * so3_exp(e.tail<3>()));
        moved = std::max(moved, 0.1 * e.cwiseAbs().maxCoeff());
      }
      const double next_cost =
          linearize(next, nullptr, nullptr, 0, nullptr) + prior(next, nullptr, nullptr);
      if (next_cost <= cost * (1 + 1e-12)) {
        x = std::move(next);
        damping = std::max(damping / 10, 1e-12);
        const double gained = cost - next_cost;
        cost = next_cost;
        if (moved < 1e-8 || gained < 1e-9 * cost) return true;
      } else {
        damping = std::max(damping * 10, 1e-6);
        if (moved < 1e-9) return true;
      }
    }
    return damping < 1e8;
  }

  /// Estimates how large residuals are, and rejects those that are far larger.
  bool judge(const State& x, bool reject) {
    Term term;
    std::vector<std::vector<double>> e2(frames_.size());
    std::vector<double> all;
    int poses = 0;
    const double before = scale_;
    scale_ = 1;
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      int used = 0;
      for (std::size_t k = 0; k < frames_[f].seen.size(); ++k) {
        const LedObservation& o = frames_[f].seen[k];
        e2[f].push_back(kRejectMost);
        if (!evaluate(camera_, x, x.poses[f], o, term)) continue;
        e2[f].back() = term.r.dot(weight(o) * term.r);
        if (rejected_[f][k]) continue;
        all.push_back(e2[f].back());
        ++used;
      }
      poses += used > 0 ? 1 : 0;
    }
    scale_ = before;
    const double terms = 2.0 * static_cast<double>(all.size());
    const double free = terms - 6 * poses - leds_ + 6;
    if (free < 6) return false;
    const double typical = median(all.begin(), all.end()) / kMedianChi2;
    scale_ = std::max(std::sqrt(typical * terms / free), 0.02);
    if (!reject) return true;
    const double limit = config_.reject_sd * config_.reject_sd * scale_ * scale_;
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      int kept = 0;
      for (std::size_t k = 0; k < e2[f].size(); ++k) {
        rejected_[f][k] = e2[f][k] > limit;
        kept += rejected_[f][k] ? 0 : 1;
      }
      // With a third of its LEDs wrong or too few right, the pose is wrong.
      if (kept < 4 || 3 * kept < 2 * static_cast<int>(e2[f].size())) {
        rejected_[f].assign(e2[f].size(), true);
      }
    }
    return true;
  }

  Result<LedAdjustment> report(const State& x) const {
    LedAdjustment out;
    out.leds = x.leds;
    out.poses = x.poses;
    out.noise_scale = scale_;
    out.depth_scale = x.depth_scale;
    Term term;
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      double sum = 0;
      int used = 0;
      for (std::size_t k = 0; k < frames_[f].seen.size(); ++k) {
        if (rejected_[f][k]) {
          ++out.rejected;
          continue;
        }
        if (!evaluate(camera_, x, x.poses[f], frames_[f].seen[k], term)) continue;
        sum += term.r.squaredNorm();
        ++used;
      }
      out.observations += used;
      out.rms_px.push_back(used > 0 ? std::sqrt(sum / used)
                                    : std::numeric_limits<double>::quiet_NaN());
    }
    uncertainty(x, out);
    return out;
  }

  void uncertainty(const State& x, LedAdjustment& out) const {
    MatrixXd S, scores, by_bias;
    VectorXd g;
    std::vector<FrameNormal> normals;
    linearize(x, &S, &g, 0, &normals, &scores, &by_bias);
    const MatrixXd data = S;
    prior(x, &S, &g);
    const MatrixXd C = S.ldlt().solve(MatrixXd::Identity(unknowns_, unknowns_));
    // Errors of successive frames go together: their gradients are summed by block.
    const auto n = static_cast<Eigen::Index>(frames_.size());
    const Eigen::Index blocks = std::min<Eigen::Index>(kBlocks, n);
    MatrixXd B = MatrixXd::Zero(unknowns_, unknowns_);
    for (Eigen::Index k = 0; k < blocks; ++k) {
      const Eigen::Index begin = k * n / blocks, end = (k + 1) * n / blocks;
      const VectorXd sum = scores.middleCols(begin, end - begin).rowwise().sum();
      B += sum * sum.transpose();
    }
    if (blocks > 1) {
      B *= static_cast<double>(blocks) / static_cast<double>(blocks - 1);
    }
    const MatrixXd cov = C.topLeftCorner(leds_, leds_);
    const MatrixXd clustered = (C * (B + (S - data)) * C).topLeftCorner(leds_, leds_);
    const double bias = config_.bias_sd_px + config_.bias_sd_share * residual_sd(x);
    const MatrixXd biased = bias * (C * by_bias).topRows(leds_);
    // What of it is left when `motions` are held.
    const auto without = [&](const MatrixXd& motions) -> MatrixXd {
      const MatrixXd keep =
          MatrixXd::Identity(leds_, leds_) - motions * motions.transpose();
      const MatrixXd a = keep * cov * keep, b = keep * clustered * keep;
      // Correlations of the formal one, the larger sd of each coordinate.
      VectorXd grow(leds_);
      for (Eigen::Index k = 0; k < leds_; ++k) {
        grow(k) = std::sqrt(std::max(1.0, b(k, k) / std::max(a(k, k), 1e-30)));
      }
      const MatrixXd shift = keep * biased;
      return grow.asDiagonal() * a * grow.asDiagonal() + shift * shift.transpose();
    };
    MatrixXd motions(leds_, 7);
    motions.leftCols<6>() = rigid_motions(x.leds);
    out.cov_shape = without(motions.leftCols<6>());
    VectorXd size = VectorXd::Zero(leds_);
    for (int k = 0; k < x.leds.size(); ++k) size.segment<3>(3 * k) = x.leds.p_BL(k);
    size -= motions.leftCols<6>() * (motions.leftCols<6>().transpose() * size);
    motions.col(6) = size.normalized();
    out.form_sd_m = without(motions).diagonal().cwiseSqrt();
    offsets(x, cov, out);
  }

  /// Of a residual along one axis, px, from the median, the poses' share given back.
  double residual_sd(const State& x) const {
    Term term;
    std::vector<double> r2;
    for (std::size_t f = 0; f < frames_.size(); ++f) {
      for (std::size_t k = 0; k < frames_[f].seen.size(); ++k) {
        if (rejected_[f][k]) continue;
        if (!evaluate(camera_, x, x.poses[f], frames_[f].seen[k], term)) continue;
        r2.push_back(term.r.squaredNorm());
      }
    }
    if (r2.empty()) return 0;
    return std::sqrt(2 * median(r2.begin(), r2.end()) / kMedianChi2);
  }

  /// How well shift, turn and size of the whole are known.
  void offsets(const State& x, const MatrixXd& cov, LedAdjustment& out) const {
    const int n = x.leds.size();
    const Vector3 middle = x.leds.middle_B();
    MatrixXd turn(leds_, 3), shift(leds_, 3);
    VectorXd size(leds_);
    for (int i = 0; i < n; ++i) {
      const Vector3 arm = x.leds.p_BL(i) - middle;
      shift.middleRows<3>(3 * i) = Matrix3::Identity() / n;
      turn.middleRows<3>(3 * i) = -hat(arm);
      size.segment<3>(3 * i) = arm;
    }
    const Matrix3 inertia = turn.transpose() * turn;
    const Matrix3 fit = inertia.inverse();
    out.shift_sd_m = (shift.transpose() * cov * shift).diagonal().cwiseSqrt();
    out.turn_cov_rad2 = fit * turn.transpose() * cov * turn * fit;
    out.scale_sd = std::sqrt(size.dot(cov * size)) / size.squaredNorm();
  }

  const LedAdjustmentConfig& config_;
  const Camera& camera_;
  const Constellation& nominal_;
  std::span<const ObservedFrame> frames_;
  int leds_, unknowns_;
  double scale_ = 1;
  std::vector<std::vector<bool>> rejected_;
};

}  // namespace

Eigen::MatrixXd rigid_motions(const Constellation& leds) {
  const int n = leds.size();
  MatrixXd motions(3 * n, 6);
  const Vector3 middle = leds.middle_B();
  for (int i = 0; i < n; ++i) {
    motions.block<3, 3>(3 * i, 0) = Matrix3::Identity();
    motions.block<3, 3>(3 * i, 3) = -hat(leds.p_BL(i) - middle) * 10;
  }
  const Eigen::HouseholderQR<MatrixXd> qr(motions);
  return qr.householderQ() * MatrixXd::Identity(3 * n, 6);
}

Result<LedAdjustment> adjust_leds(const LedAdjustmentConfig& config,
                                  const Camera& camera, const Constellation& nominal,
                                  const Constellation& start,
                                  std::span<const ObservedFrame> frames) {
  return Adjuster(config, camera, nominal, frames).run(start);
}

}  // namespace alight
