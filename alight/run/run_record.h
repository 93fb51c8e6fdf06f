#pragma once
#include <memory>
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/run/landing_run.h"

namespace alight {

/// result.json of CONTRACT; NaN becomes null.
std::string result_json(const LandingResult& result);

/// Keeps what a run says and leaves it in a folder: scenario, rigs, TUM files,
/// frames.jsonl, events.jsonl, result.json and pictures (CONTRACT: What a run leaves).
class RunRecord final : public RunObserver {
 public:
  explicit RunRecord(const LandingRunOptions& options);
  ~RunRecord() override;

  void on_world(const World& world) override;
  void on_picture(const CameraFrame& frame) override;
  void on_step(const Output& output, const TruthState& truth, double us) override;
  void on_frame(const FrameReport& frame, const TruthState& truth, double us) override;
  void on_plan(const PlanRequest& request, const PlanResult& result) override;

  /// Writes the folder. io when the disk refuses.
  /// @returns the names of the pictures, within the folder.
  Result<std::vector<std::string>> save(const std::string& folder,
                                        const LandingResult& result) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace alight
