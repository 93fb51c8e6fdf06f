#include "alight/eval/path_error.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>

#include "alight/eval/statistics.h"

namespace alight {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kTrackedWithin_m = 0.15;
constexpr double kTrackedWithin_rad = 15 * kDegree;

std::vector<double> distances(const PosePairs& pairs) {
  std::vector<double> d;
  d.reserve(pairs.size());
  for (const PosePair& pair : pairs) {
    d.push_back((pair.estimate.translation() - pair.truth.translation()).norm());
  }
  return d;
}

}  // namespace

PosePairs associate(const PoseLog& estimate, const PoseLog& truth, Seconds max_dt) {
  PosePairs pairs;
  const Time limit = from_seconds(max_dt);
  std::size_t next = 0;  // the first truth that is still free
  for (const auto& [t, X] : estimate) {
    if (next == truth.size()) break;
    const auto gap = [&, t = t](std::size_t i) { return std::abs(truth[i].first - t); };
    // Of several truths of one instant the first, so that each finds its estimate.
    for (std::size_t i = next + 1; i < truth.size() && gap(i) <= gap(next); ++i) {
      if (gap(i) < gap(next)) next = i;
    }
    if (gap(next) > limit) continue;
    pairs.push_back({t, X, truth[next].second});
    ++next;
  }
  return pairs;
}

Result<PosePairs> associate_rows(const PoseLog& estimate, const PoseLog& truth) {
  if (estimate.size() != truth.size()) {
    return fail(Fault::invalid_input,
                std::to_string(estimate.size()) + " estimates but " +
                    std::to_string(truth.size()) +
                    " truths: they cannot be paired row by row, give --max-dt");
  }
  PosePairs pairs;
  pairs.reserve(estimate.size());
  for (std::size_t i = 0; i < estimate.size(); ++i) {
    pairs.push_back({estimate[i].first, estimate[i].second, truth[i].second});
  }
  return pairs;
}

Result<Pose> fit_se3(const PosePairs& pairs) {
  if (pairs.size() < 3) return fail(Fault::too_few_points, "a fit needs 3 poses");
  const double share = 1.0 / static_cast<double>(pairs.size());
  Vector3 mean_e = Vector3::Zero();
  Vector3 mean_t = Vector3::Zero();
  for (const PosePair& pair : pairs) {
    mean_e += share * pair.estimate.translation();
    mean_t += share * pair.truth.translation();
  }
  Matrix3 cross = Matrix3::Zero();
  for (const PosePair& pair : pairs) {
    cross += share * (pair.truth.translation() - mean_t) *
             (pair.estimate.translation() - mean_e).transpose();
  }
  const Eigen::JacobiSVD<Matrix3> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vector3 spread = svd.singularValues();
  // Points on one line leave the rotation about it open.
  if (!(spread[1] > 1e-9 * spread[0]) || spread[0] < 1e-18) {
    return fail(Fault::degenerate, "the path is a line or a point: no fit is unique");
  }
  Matrix3 mirror = Matrix3::Identity();
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) mirror(2, 2) = -1;
  const Matrix3 R = svd.matrixU() * mirror * svd.matrixV().transpose();
  return make_pose(R, mean_t - R * mean_e);
}

PosePairs moved(const PosePairs& pairs, const Pose& X) {
  PosePairs result = pairs;
  for (PosePair& pair : result) pair.estimate = X * pair.estimate;
  return result;
}

Result<Matrix3> mean_rotation(const std::vector<Matrix3>& rotations) {
  if (rotations.empty()) return fail(Fault::too_few_points, "no rotations");
  Matrix3 R = rotations.front();
  for (int i = 0; i < 100; ++i) {
    Vector3 step = Vector3::Zero();
    for (const Matrix3& R_i : rotations) step += so3_log(R.transpose() * R_i);
    step /= static_cast<double>(rotations.size());
    R = orthonormalized(R * so3_exp(step));
    if (step.norm() < 1e-10) return R;
  }
  return fail(Fault::degenerate, "the rotations have no clear mean");
}

Result<PathError> path_error(const PosePairs& pairs) {
  if (pairs.empty()) return fail(Fault::too_few_points, "no estimate has a truth");
  PathError error;
  error.count = static_cast<int>(pairs.size());

  const std::vector<double> d = distances(pairs);
  error.position_rmse_m = rms(d);
  error.position_p95_m = percentile(d, 0.95);
  error.position_max_m = *std::max_element(d.begin(), d.end());
  const auto X = fit_se3(pairs);
  error.position_fitted_rmse_m = X ? rms(distances(moved(pairs, *X))) : kNan;

  std::vector<Matrix3> differences;
  std::vector<double> angles;
  int tracked = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    differences.push_back(pairs[i].truth.linear().transpose() *
                          pairs[i].estimate.linear());
    angles.push_back(so3_log(differences.back()).norm());
    if (d[i] <= kTrackedWithin_m && angles[i] <= kTrackedWithin_rad) ++tracked;
  }
  error.rotation_rmse_rad = rms(angles);
  error.rotation_max_rad = *std::max_element(angles.begin(), angles.end());
  error.success = static_cast<double>(tracked) / error.count;

  const auto R_mean = mean_rotation(differences);
  error.rotation_mean_out_rmse_rad = kNan;
  if (R_mean) {
    std::vector<double> rest;
    for (const Matrix3& R : differences) {
      rest.push_back(so3_log(R_mean->transpose() * R).norm());
    }
    error.rotation_mean_out_rmse_rad = rms(rest);
  }
  return error;
}

}  // namespace alight
