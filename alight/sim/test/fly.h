#pragma once
#include <functional>
#include <memory>

#include "alight/sim/world.h"

namespace alight::fly {

/// The world of tests: nothing random but where the drone stands.
inline Scenario calm(PlatformKind kind = PlatformKind::still) {
  Scenario scenario;
  scenario.platform.kind = kind;
  return perfect_world(scenario);
}

inline std::unique_ptr<World> make(const Scenario& scenario, std::uint64_t seed = 1) {
  auto world = World::create(scenario, alan_rig(), seed);
  return world ? std::move(*world) : nullptr;
}

inline Setpoint attitude(const Matrix3& R_IB, double thrust) {
  Setpoint s;
  s.kind = Setpoint::Kind::attitude;
  s.q_IB = Eigen::Quaterniond(R_IB);
  s.thrust = thrust;
  return s;
}

inline Setpoint velocity(const Vector3& v_IB, double yaw = 0) {
  Setpoint s;
  s.kind = Setpoint::Kind::velocity;
  s.v_IB = v_IB;
  s.yaw = yaw;
  return s;
}

/// Runs until `end_s` at 100 Hz, sending the true pose and what `pilot` says.
inline void run(World& world, double end_s,
                const std::function<Setpoint(const TruthState&)>& pilot,
                const std::function<void(const TruthState&)>& look = {}) {
  const Time tick = 10'000'000;
  for (Time t = world.truth().t; t < from_seconds(end_s);) {
    const TruthState now = world.truth();
    ExternalPose pose;
    pose.captured = now.t;
    pose.X_IB = now.X_IB;
    pose.v_IB = now.v_IB;
    world.send(pose, now.t);
    world.send(pilot(now), now.t);
    for (const Time stop = t + tick; t < stop;) {
      t += World::kStep;
      world.advance_to(t);
      if (look) look(world.truth());
    }
  }
}

/// Off the pad or floor by velocity set-points, then still in the air at `end_s`.
inline void take_off(World& world, double end_s = 6) {
  world.send(AutopilotOrder::arm, world.truth().t);
  const double floor = world.truth().X_IB.translation().z();
  run(world, end_s, [&](const TruthState& x) {
    const double climb = 1.0 * (floor + 1.5 - x.X_IB.translation().z());
    return velocity(Vector3(0, 0, std::clamp(climb, -0.5, 0.8)));
  });
}

}  // namespace alight::fly
