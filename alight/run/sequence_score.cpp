#include "alight/run/sequence_score.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <limits>

#include "alight/mission/relative_estimator.h"
#include "alight/run/cpu_time.h"

namespace alight {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kWrongM = 0.15;
constexpr double kWrongRad = 15 * kDegree;
constexpr double kSure = 30;

template <int N>
double mahalanobis(const Eigen::Matrix<double, N, 1>& e,
                   const Eigen::Matrix<double, N, N>& cov) {
  const Eigen::LLT<Eigen::Matrix<double, N, N>> root(cov);
  return root.info() == Eigen::Success ? e.dot(root.solve(e)) : kNaN;
}

}  // namespace

bool FrameScore::wrong() const {
  return tracked && !(position_m <= kWrongM && rotation_rad <= kWrongRad);
}

bool FrameScore::surely_wrong() const { return wrong() && !(nees_pose >= kSure); }

FrameScore score_frame(const FrameReport& report, const RelativeState& truth,
                       const Vector3& p_NC) {
  FrameScore score;
  score.tracked = report.tracked;
  score.found = report.initialized;
  score.range_m = (truth.p_NB - p_NC).norm();
  score.speed_m_s = truth.v_NB.norm();
  score.position_m = score.rotation_rad = score.velocity_m_s = kNaN;
  score.nees_pose = score.nees_state = kNaN;
  for (const LedUse& use : report.leds) {
    score.nis_sum += use.nis;
    ++score.observations;
  }
  if (!report.tracked) return score;
  const Vector9 e = boxminus(truth, report.x);
  score.position_m = e.head<3>().norm();
  score.rotation_rad = e.segment<3>(3).norm();
  score.velocity_m_s = e.tail<3>().norm();
  score.nees_pose = mahalanobis<6>(e.head<6>(), report.cov.topLeftCorner<6, 6>());
  score.nees_state = mahalanobis<9>(e, report.cov);
  return score;
}

Result<std::vector<FrameScore>> score_sequence(Sequence& sequence, const Rig& rig,
                                               Profile profile,
                                               std::size_t bytes_held) {
  const auto config = profile == Profile::paper
                          ? RelativeEstimatorConfig::paper()
                          : RelativeEstimatorConfig::camera_only();
  auto estimator = RelativeEstimator::create(config, rig);
  if (!estimator) return fail(estimator.error());
  const Vector3 p_NC = sequence.true_rig().camera.X_NC.translation();
  const NoMotion motion;
  const Intrinsics& lens = rig.camera.intrinsics;
  MadeInBulk<ColorBuffer> pictures(
      [&, k = 0](ColorBuffer& one) mutable -> Result<bool> {
        if (k == sequence.frames()) return false;
        if (auto good = sequence.render(k++, one); !good) return fail(good.error());
        return true;
      },
      3u * static_cast<unsigned>(lens.width * lens.height), bytes_held);
  ColorBuffer color;
  FrameReport report;
  std::vector<FrameScore> scores;
  for (int k = 0;; ++k) {
    const auto more = pictures.next(color);
    if (!more) return fail(more.error());
    if (!*more) break;
    CameraFrame frame;
    frame.captured = frame.received = sequence.time(k);
    frame.color = color.view();
    const double begin = thread_cpu_us();
    estimator->fuse(frame, motion, report);
    const double took = thread_cpu_us() - begin;
    scores.push_back(score_frame(report, sequence.truth(k), p_NC));
    scores.back().cpu_us = took;
  }
  return scores;
}

}  // namespace alight
