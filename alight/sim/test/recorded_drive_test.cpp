#include "alight/sim/recorded_drive.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "alight/base/rng.h"
#include "alight/sim/platform_motion.h"

namespace alight {
namespace {

/// A boat of sorts that begins and ends at rest, at times without a pattern.
PoseLog drive(std::uint64_t seed, double end_s = 6) {
  Rng rng(seed);
  const double side = rng.uniform(-2, 2), roll = rng.uniform(-0.3, 0.3);
  const double turn = rng.uniform(-4, 4);  // through more than pi either way
  PoseLog log;
  for (double t = 0; t < end_s; t += rng.uniform(0.01, 0.1)) {
    const double u = t / end_s;
    const double s = u * u * (3 - 2 * u);
    log.emplace_back(from_seconds(1e9 + t),
                     make_pose(from_rpy(roll * s, 0.2 * std::sin(3 * s), 3 + turn * s),
                               {3 * s, side * s * s, 1 + 0.3 * std::sin(2 * s)}));
  }
  const Pose last = log.back().second;
  log.emplace_back(log.back().first + 20'000'000, last);
  return log;
}

/// The same, cut off at both ends while it moves.
PoseLog cut_out(std::uint64_t seed) {
  const PoseLog whole = drive(seed);
  const auto quarter = static_cast<std::ptrdiff_t>(whole.size() / 4);
  return {whole.begin() + quarter, whole.end() - quarter};
}

double apart(const Pose& a, const Pose& b) {
  return (a.translation() - b.translation()).norm() +
         angle_between(a.linear(), b.linear());
}

class Drives : public testing::TestWithParam<std::uint64_t> {};

TEST_P(Drives, PassThroughEveryPoseAtItsTime) {
  const PoseLog log = drive(GetParam());
  const auto recorded = RecordedDrive::create(log);
  ASSERT_TRUE(recorded) << recorded.error().detail;
  for (const auto& [t, X_IN] : log) {
    const double s = to_seconds(t - log.front().first);
    EXPECT_LT(apart(recorded->at(s).X_IN, X_IN), 1e-9) << s;
  }
}

TEST_P(Drives, MoveAsTheirDerivativesSay) {
  for (const PoseLog& log : {drive(GetParam()), cut_out(GetParam())}) {
    const auto recorded = RecordedDrive::create(log);
    ASSERT_TRUE(recorded) << recorded.error().detail;
    const double h = 1e-5;
    Rng rng(GetParam());
    for (int k = 0; k < 200; ++k) {
      const double t = rng.uniform(-0.5, recorded->duration() + 0.5);
      const PlatformState now = recorded->at(t);
      const PlatformState ago = recorded->at(t - h), ahead = recorded->at(t + h);
      const Matrix3 R_NI = now.X_IN.linear().transpose();
      const Vector3 v_N =
          R_NI * (ahead.X_IN.translation() - ago.X_IN.translation()) / (2 * h);
      EXPECT_LT((v_N - now.v_IN_N).norm(), 1e-4) << t;
      const Vector3 w_N =
          so3_log(ago.X_IN.linear().transpose() * ahead.X_IN.linear()) / (2 * h);
      EXPECT_LT((w_N - now.w_IN_N).norm(), 1e-4) << t;
      const Vector3 dv_I =
          ahead.X_IN.linear() * ahead.v_IN_N - ago.X_IN.linear() * ago.v_IN_N;
      const Vector3 alpha = (ahead.w_IN_N - ago.w_IN_N) / (2 * h);
      // A ramp's own edges have no derivative; they are met with probability 0.
      EXPECT_LT((R_NI * dv_I / (2 * h) - now.a_IN_N).norm(), 2e-2) << t;
      EXPECT_LT((alpha - now.alpha_IN_N).norm(), 5e-2) << t;
    }
  }
}

TEST_P(Drives, BeginAndEndAtRestWhereverTheRecordingWasCut) {
  const PoseLog log = cut_out(GetParam());
  const auto recorded = RecordedDrive::create(log);
  ASSERT_TRUE(recorded);
  EXPECT_GT(recorded->duration(), to_seconds(log.back().first - log.front().first));
  const PlatformState first = recorded->at(-1), begin = recorded->at(1e-6);
  const PlatformState end = recorded->at(recorded->duration() - 1e-6);
  const PlatformState last = recorded->at(recorded->duration() + 100);
  EXPECT_LT(apart(first.X_IN, log.front().second), 1e-9);
  EXPECT_LT(apart(last.X_IN, log.back().second), 1e-9);
  for (const PlatformState& state : {first, begin, end, last}) {
    EXPECT_LT(state.v_IN_N.norm() + state.w_IN_N.norm(), 1e-4);
  }
}
INSTANTIATE_TEST_SUITE_P(Seeds, Drives, testing::Range<std::uint64_t>(0, 20));

TEST(RecordedDrive, NamesTheTimeOfWhatNoPadDoes) {
  const auto why = [](const PoseLog& log) {
    const auto made = RecordedDrive::create(log);
    return made ? std::string() : made.error().detail;
  };
  PoseLog log = drive(1);
  EXPECT_EQ(why(log), "");
  EXPECT_NE(why({}).find("two poses"), std::string::npos);
  EXPECT_NE(why({log[0]}).find("two poses"), std::string::npos);
  const auto with = [&](auto&& spoil) {
    PoseLog other = log;
    other.front().first = 0;
    for (std::size_t i = 0; i < other.size(); ++i) {
      other[i].first = static_cast<Time>(i) * 50'000'000;
    }
    spoil(other[10]);
    return why(other);
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const std::string& text :
       {with([](auto& row) { row.first = 0; }),
        with([](auto& row) { row.second.translation().z() = -1; }),
        with([&](auto& row) { row.second.translation().x() = nan; }),
        with([](auto& row) { row.second.translation().y() = 1e5; }),
        with([](auto& row) { row.second.linear() = from_rpy(1, 0, 0); }),
        with([](auto& row) { row.second.translation().x() += 5; })}) {
    EXPECT_EQ(text.find("at t = 0"), 0u) << text;
  }
}

TEST(RecordedPlatform, WaitsForItsStartAndTakesNoWishes) {
  PlatformScenario config;
  config.kind = PlatformKind::recorded;
  config.drive = drive(3);
  const auto recorded = RecordedDrive::create(config.drive);
  ASSERT_TRUE(recorded);
  PlatformMotion motion(config, 0.26, false, Rng(1));
  for (int k = 0; k < 500; ++k) motion.step(0.002);
  EXPECT_EQ(motion.state().t, 1'000'000'000);
  EXPECT_LT(apart(motion.state().X_IN, config.drive.front().second), 1e-9);
  EXPECT_EQ(motion.state().v_IN_N.norm(), 0);
  motion.start();
  motion.wish_speed(0);
  for (int k = 0; k < 1000; ++k) motion.step(0.002);
  EXPECT_LT(apart(motion.state().X_IN, recorded->at(2).X_IN), 1e-9);
  EXPECT_GT(motion.state().v_IN_N.norm(), 0.1);
}

}  // namespace
}  // namespace alight
