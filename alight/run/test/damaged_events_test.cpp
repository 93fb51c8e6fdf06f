// What sensors and radios deliver when they break: numbers that are none, that nothing
// can be, times of yesterday and tomorrow. The brain refuses it and flies on.
#include <cmath>
#include <limits>

#include "alight/base/rng.h"
#include "bare_loop.h"

namespace alight {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr Time kFirst = std::numeric_limits<Time>::min();
constexpr Time kLast = std::numeric_limits<Time>::max();

int pick(Rng& rng, int count) {
  return std::min(static_cast<int>(rng.uniform() * count), count - 1);
}

double no_number(Rng& rng) {
  constexpr double kNone[] = {kNaN, kInf, -kInf, 1e300, -1e30, 1e9};
  return kNone[pick(rng, 6)];
}

void spoil(Vector3& v, Rng& rng) { v[pick(rng, 3)] = no_number(rng); }

Time no_time(Time now, Rng& rng) {
  const Time none[] = {now - from_seconds(0.6), now + from_seconds(0.02),
                       now + from_seconds(86400), kFirst, kLast};
  return none[pick(rng, 5)];
}

/// Each breaks something, so that the event must be refused.
void spoil(CameraFrame& frame, Time now, Rng& rng) {
  switch (pick(rng, 6)) {
    case 0:
      frame.captured = no_time(now, rng);
      break;
    case 1:
      frame.color.data = nullptr;
      break;
    case 2:
      frame.color.width += 1 - 2 * pick(rng, 2);
      break;
    case 3:
      frame.color.channels = 2;
      break;
    case 4:
      frame.color.stride = -frame.color.stride;
      break;
    default:
      frame.depth = {reinterpret_cast<const std::uint16_t*>(frame.color.data), 3, 3, 3};
  }
}
void spoil(PlatformOdometry& o, Time now, Rng& rng) {
  Matrix3 R = o.X_IN.linear();
  switch (pick(rng, 6)) {
    case 0:
      o.captured = no_time(now, rng);
      break;
    case 1: {
      Vector3 p = o.X_IN.translation();
      spoil(p, rng);
      o.X_IN.translation() = p;
      break;
    }
    case 2:
      spoil(o.v_IN_N, rng);
      break;
    case 3:
      spoil(o.w_IN_N, rng);
      break;
    case 4:
      R.col(pick(rng, 3)) *= pick(rng, 2) ? -1 : 0;
      o.X_IN.linear() = R;
      break;
    default:
      R(pick(rng, 3), pick(rng, 3)) = no_number(rng);
      o.X_IN.linear() = R;
  }
}
void spoil(PlatformImu& imu, Time now, Rng& rng) {
  switch (pick(rng, 3)) {
    case 0:
      imu.captured = no_time(now, rng);
      break;
    case 1:
      spoil(imu.f_N, rng);
      break;
    default:
      spoil(imu.w_IN_N, rng);
  }
}
void spoil(AutopilotTelemetry& t, Time now, Rng& rng) {
  switch (pick(rng, 6)) {
    case 0:
      t.captured = no_time(now, rng);
      break;
    case 1:
      t.q_IB.coeffs()[pick(rng, 4)] = no_number(rng);
      break;
    case 2:
      t.q_IB.coeffs() *= pick(rng, 2) ? 2 : 0;
      break;
    case 3:
      spoil(t.w_IB_B, rng);
      break;
    case 4:
      spoil(t.v_IB, rng);
      break;
    default:
      t.battery = pick(rng, 2) ? kNaN : kInf;
  }
}
void spoil(LinkStatus& status, Time now, Rng& rng) {
  if (pick(rng, 2)) {
    status.round_trip_ms = pick(rng, 2) ? kNaN : -kInf;
  } else {
    status.last_answer = pick(rng, 2) ? now + from_seconds(3) : kLast;
  }
}

/// A copy of one of the step's sensor events, broken; false when there is none.
bool broken_copy(const std::vector<Event>& events, Time now, Rng& rng, Event& out) {
  if (events.empty()) return false;
  out = events[static_cast<std::size_t>(pick(rng, static_cast<int>(events.size())))];
  return std::visit(
      [&](auto& event) {
        if constexpr (requires { spoil(event, now, rng); }) {
          spoil(event, now, rng);
          return true;
        } else {
          return false;
        }
      },
      out);
}

void expect_same(const Output& a, const Output& b) {
  EXPECT_EQ(a.mission.state, b.mission.state)
      << a.mission.reason << ", " << b.mission.reason;
  EXPECT_EQ(a.order, b.order);
  EXPECT_EQ(a.setpoint.kind, b.setpoint.kind);
  EXPECT_EQ(a.setpoint.q_IB.coeffs(), b.setpoint.q_IB.coeffs());
  EXPECT_EQ(a.setpoint.thrust, b.setpoint.thrust);
  EXPECT_EQ(a.has_external_pose, b.has_external_pose);
  EXPECT_EQ(a.external_pose.X_IB.matrix(), b.external_pose.X_IB.matrix());
  EXPECT_EQ(a.trace.predicted.p_NB, b.trace.predicted.p_NB);
  EXPECT_EQ(a.trace.link_delay_ms, b.trace.link_delay_ms);
}

class DamagedEvents : public testing::TestWithParam<unsigned> {};

/// Two brains in the same world; one of them is told broken things besides. They say
/// the same to the last bit.
TEST_P(DamagedEvents, AreCountedAndChangeNothing) {
  LandingRunOptions options = test::options_of("circle", GetParam());
  options.scenario.odometry.imu_rate_hz = 100;
  const LandingConfig config = LandingConfig::standard(options.rig);
  test::BareLoop clean(options, config), troubled(options, config);
  Rng rng(GetParam());
  std::uint32_t broken = 0;
  while (clean.seconds() < 14 && !HasFailure() &&
         clean.out.mission.state != MissionState::complete) {
    clean.step();
    troubled.gather();
    const std::vector<Event> whole = troubled.events;
    Event event;
    for (int i = 0; i < 2; ++i) {
      if (!broken_copy(whole, troubled.now(), rng, event)) continue;
      const auto place = pick(rng, static_cast<int>(troubled.events.size()) + 1);
      troubled.events.insert(troubled.events.begin() + place, event);
      ++broken;
    }
    troubled.think();
    troubled.act();
    expect_same(clean.out, troubled.out);
    EXPECT_EQ(troubled.out.trace.events_refused,
              clean.out.trace.events_refused + broken);
    if (HasFailure()) ADD_FAILURE() << "at " << clean.seconds() << " s";
  }
  EXPECT_GT(broken, 500u);
  EXPECT_EQ(clean.out.mission.state, MissionState::complete)
      << clean.out.mission.reason;
}

/// What a step says is something an autopilot can fly, whatever the brain was told.
void expect_flyable(const Output& out, const Rig& rig) {
  const Setpoint& s = out.setpoint;
  EXPECT_NEAR(s.q_IB.norm(), 1, 1e-6);
  EXPECT_TRUE(s.thrust >= 0 && s.thrust <= 1) << s.thrust;
  const Vector3 up = s.q_IB * Vector3::UnitZ();
  if (out.trace.reference_valid) {
    EXPECT_GE(up.z(), std::cos((rig.drone.tilt_max_deg + 15) * kDegree));
  }
  EXPECT_TRUE(s.v_IB.allFinite() && s.a_IB.allFinite() && std::isfinite(s.yaw) &&
              std::isfinite(s.yaw_rate));
  EXPECT_TRUE(out.platform_speed_wish >= 0 && out.platform_speed_wish <= 1);
  if (out.has_external_pose) {
    EXPECT_TRUE(out.external_pose.X_IB.matrix().allFinite());
    EXPECT_TRUE(out.external_pose.v_IB.allFinite());
    EXPECT_GT(out.external_pose.cov.diagonal().minCoeff(), 0);
  }
  if (out.trace.estimate_valid) {
    EXPECT_TRUE(out.trace.predicted.p_NB.allFinite());
    EXPECT_TRUE(out.trace.predicted_cov.allFinite());
  }
}

/// A quarter of all that is heard is broken, lost, heard twice or swapped.
TEST_P(DamagedEvents, InPlaceOfGoodOnesLeaveWhatCanBeFlown) {
  const LandingRunOptions options = test::options_of("circle", 100 + GetParam());
  test::BareLoop loop(options, LandingConfig::standard(options.rig));
  Rng rng(GetParam());
  while (loop.seconds() < 14 && !HasFailure() &&
         loop.out.mission.state != MissionState::complete) {
    loop.gather();
    std::vector<Event> heard;
    for (const Event& event : loop.events) {
      const double chance = rng.uniform();
      Event broken;
      if (chance < 0.1 && broken_copy({event}, loop.now(), rng, broken)) {
        heard.push_back(broken);
      } else if (chance < 0.15) {
        heard.push_back(event);
        heard.push_back(event);
      } else if (chance < 0.2) {
        heard.insert(heard.begin(), event);
      } else if (chance > 0.25 || std::holds_alternative<OperatorInput>(event)) {
        heard.push_back(event);
      }
    }
    loop.events = heard;
    loop.think();
    loop.act();
    expect_flyable(loop.out, options.rig);
    if (HasFailure()) ADD_FAILURE() << "at " << loop.seconds() << " s";
  }
  EXPECT_GT(loop.seconds(), 3);
}

INSTANTIATE_TEST_SUITE_P(Seeds, DamagedEvents, testing::Range(1u, 5u));

}  // namespace
}  // namespace alight
