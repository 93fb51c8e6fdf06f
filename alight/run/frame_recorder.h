#pragma once
#include <string>
#include <vector>

#include "alight/run/landing_run.h"

namespace alight {

/// Leaves the pictures of a run as a SOURCE folder (CONTRACT): frames.csv with the
/// pictures and their depth as PNG, so that `alight track` sees, bit for bit, what the
/// brain saw; beside them truth.tum, rig.yaml, rig_true.yaml and scenario.yaml.
class FrameRecorder final : public RunObserver {
 public:
  /// @param folder  Made when the first picture comes; what an earlier run left there
  ///                is overwritten picture by picture.
  FrameRecorder(std::string folder, const LandingRunOptions& options);

  void on_world(const World& world) override;
  void on_picture(const CameraFrame& frame) override;
  void on_frame(const FrameReport& frame, const TruthState& truth, double us) override;

  /// Writes the lists, frames.csv last. io: the first that the disk refused.
  Result<int> finish();

 private:
  std::string folder_;
  LandingRunOptions options_;
  Rig rig_true_;
  std::string list_ = "t,file\n";
  PoseLog truth_;
  int pictures_ = 0;
  bool depth_ = false;
  Time last_ = INT64_MIN;
  Result<void> good_;
};

/// Hands everything on to several observers, in order.
class Observers final : public RunObserver {
 public:
  void add(RunObserver& observer) { all_.push_back(&observer); }
  bool empty() const { return all_.empty(); }

  void on_world(const World& world) override;
  void on_picture(const CameraFrame& frame) override;
  void on_step(const Output& output, const TruthState& truth, double us) override;
  void on_frame(const FrameReport& frame, const TruthState& truth, double us) override;
  void on_plan(const PlanRequest& request, const PlanResult& result) override;

 private:
  std::vector<RunObserver*> all_;
};

}  // namespace alight
