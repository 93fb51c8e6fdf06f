#pragma once
#include <optional>

#include "alight/base/rng.h"
#include "alight/base/time.h"
#include "alight/geometry/platform_state.h"
#include "alight/platform/ugv_controller.h"
#include "alight/sim/recorded_drive.h"
#include "alight/sim/scenario.h"
#include "alight/sim/seaway.h"

namespace alight {

/// What the platform does against all orders (faults pad_start, pad_stop, pad_turn).
struct PadMutiny {
  std::optional<double> speed_m_s;
  std::optional<double> turn_rad_s;  ///< To the left.
  bool any() const { return speed_m_s || turn_rad_s; }
};

/// How the platform truly moves: a UGV on its path (without slip), or a boat on a
/// straight course in a seaway, or a drive that was recorded.
class PlatformMotion {
 public:
  /// `height` of the pad above the floor, m; recorded drives and boats bring their own.
  /// @pre A recorded drive holds (RecordedDrive::create).
  PlatformMotion(const PlatformScenario& config, double height, bool moving, Rng rng);

  void start() { moving_ = true; }
  /// At most the scenario's speed. A recorded drive takes no wishes.
  void wish_speed(double m_s);

  /// Advances by `dt` s. What a mutiny leaves open stays as it was, the curve for the
  /// turn; after it the drive goes on from where it has led, as if the path lay there.
  /// Recorded drives know none.
  void step(Seconds dt, const PadMutiny& mutiny = {});

  const PlatformState& state() const { return state_; }

 private:
  UgvCommand drive(Seconds dt);
  UgvCommand rebel(const PadMutiny& mutiny, Seconds dt);
  UgvPose on_path() const;
  /// `before`: the course's motion up to this step.
  void step_boat(const UgvCommand& before, Seconds dt);
  void step_recorded(Seconds dt);

  PlatformScenario config_;
  double height_;
  bool moving_;
  double wish_;
  PlatformState state_;
  Path path_;
  UgvController controller_;
  UgvPose pose_;
  UgvCommand command_;
  std::optional<RecordedDrive> drive_;
  Seconds driven_ = 0;  ///< s into it
  std::optional<Seaway> sea_;
  bool mutinous_ = false;
  bool disturbed_ = false;  ///< Not yet back at what the controller wants.
  UgvPose left_;            ///< On the path, when the mutiny began.
  UgvCommand was_;          ///< Then.
  UgvPose moved_;           ///< Where mutinies have put the path's origin.
};

}  // namespace alight
