#pragma once
#include <gtest/gtest.h>

#include <array>
#include <deque>
#include <memory>
#include <vector>

#include "alight/mission/landing_system.h"
#include "alight/planning/planner.h"
#include "alight/run/landing_run.h"
#include "alight/sim/camera_renderer.h"
#include "alight/sim/world.h"
#include "run_scenarios.h"

namespace alight::test {

/// The closed loop of run_landing, bare: a test may come between its parts.
class BareLoop {
 public:
  BareLoop(const LandingRunOptions& options, const LandingConfig& config)
      : rig_(options.rig),
        world_(World::create(options.scenario, options.rig, options.seed).value()),
        renderer_(
            CameraRenderer::create({}, world_->true_rig().rig, options.seed).value()),
        brain_(LandingSystem::create(config, options.rig).value()),
        planner_(Planner::create({}, options.rig).value()) {
    black_.clear(rig_.camera.intrinsics.width, rig_.camera.intrinsics.height);
  }

  void step() {
    gather();
    think();
    act();
  }

  /// The world goes on by 10 ms; `events` are what the brain gets of it.
  void gather() {
    now_ += from_seconds(0.01);
    world_->advance_to(now_);
    take_pictures();
    collect();
  }
  void think() { brain_.step({now_, events}, out); }
  void act() {
    world_->send(out.setpoint, now_);
    if (out.has_external_pose) world_->send(out.external_pose, now_);
    if (out.order != AutopilotOrder::none) world_->send(out.order, now_);
    if (out.mission.state == MissionState::follow) world_->start_platform();
    if (out.has_plan_request) {
      plans_.push_back({now_ + from_seconds(0.02), planner_.plan(out.plan_request)});
    }
  }

  Time now() const { return now_; }
  double seconds() const { return to_seconds(now_); }

  std::vector<Event> events;
  Output out;
  bool dark = false;  ///< Pictures are black.

 private:
  void take_pictures() {
    const double period = 1 / rig_.timing.rate_hz;
    const Time half = from_seconds(0.5e-3 * rig_.timing.exposure_ms);
    for (;;) {
      const Time t = from_seconds((static_cast<double>(taken_) + 0.5) * period);
      if (t + half > now_) break;
      const auto scene = [&](Time at) {
        const TruthState truth = world_->truth_at(at);
        return SceneAt{truth.platform.X_IN, truth.X_NB};
      };
      const std::array<SceneAt, 3> scenes{scene(t - half), scene(t), scene(t + half)};
      pictures_.emplace_back();
      EXPECT_TRUE(renderer_.render(taken_, scenes, pictures_.back(), nullptr));
      CameraFrame frame;
      frame.captured = t;
      frame.received = t + from_seconds(1e-3 * rig_.timing.frame_to_use_ms);
      frame.color = dark ? black_.view() : pictures_.back().view();
      frames_.push_back(frame);
      ++taken_;
    }
  }

  void collect() {
    events.clear();
    batch_.clear();
    world_->collect(now_, batch_);
    for (const auto& e : batch_.odometry) events.emplace_back(e);
    for (const auto& e : batch_.imu) events.emplace_back(e);
    for (const auto& e : batch_.telemetry) events.emplace_back(e);
    for (const auto& e : batch_.link) events.emplace_back(e);
    while (!frames_.empty() && frames_.front().received <= now_) {
      events.emplace_back(frames_.front());
      frames_.pop_front();
    }
    while (pictures_.size() > 8) pictures_.pop_front();
    while (!plans_.empty() && plans_.front().received <= now_) {
      events.emplace_back(plans_.front());
      plans_.pop_front();
    }
    if (now_ == from_seconds(1)) {
      events.emplace_back(OperatorInput{now_, now_, OperatorWish::go});
    }
  }

  Rig rig_;
  std::unique_ptr<World> world_;
  CameraRenderer renderer_;
  LandingSystem brain_;
  Planner planner_;
  Time now_ = 0;
  std::uint64_t taken_ = 0;
  SensorBatch batch_;
  std::deque<ColorBuffer> pictures_;
  ColorBuffer black_;
  std::deque<CameraFrame> frames_;
  std::deque<PlanArrival> plans_;
};

}  // namespace alight::test
