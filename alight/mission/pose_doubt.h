#pragma once
#include <optional>

#include "alight/estimation/push.h"
#include "alight/mission/other_poses.h"

namespace alight {

struct PoseDoubtConfig {
  double refuted = 10;  ///< Evidence from which on another reading takes the pose's
                        ///< place,
  double open = 3;      ///< and down to which, negative, it is not yet refuted itself.
  double weight = 0.5;  ///< Of a picture's word: what a wrong rig does to it, it does
                        ///< to the next one, too,
  double remembers = 0.98;  ///< and what pictures have said long ago counts less.
  double floor_px = 0.02;   ///< No light's place is known better.
  double apart_m = 0.1;     ///< Poses nearer than this
  double apart_deg = 10;    ///< and turned less are told for each other.
  double across_sd = 1.7;   ///< Wind pushes drones across by so much, m/s^2;
  double across_most = 12;  ///< how one leans speaks so far at most.
};

/// Holds the pose that is followed by no more than four LEDs against what these lights
/// may be besides. So few fit several readings, and a filter that was started on the
/// wrong one, or has slipped into its mirror image, goes on with it for as long as it
/// sees no more.
///
/// No allocation.
class PoseDoubt {
 public:
  static constexpr std::size_t kFew = 4;

  explicit PoseDoubt(const PoseDoubtConfig& config) : config_(config) {}

  void clear();
  /// Five LEDs and more, seen together: none of them is another.
  void be_sure(ObservationSpan seen) {
    clear();
    sure_ = leds_of(seen);
  }

  /// What pushes the drone, if that is known, besides how the pose leans; before
  /// look(), which it holds for.
  void feel(const std::optional<Push>& push) { push_ = push; }

  /// One picture more. @param seen  Each of one LED.
  void look(const Camera& camera, const Constellation& leds, bool use_color,
            const LedFinder& plausible, ObservationSpan seen, const Pose& X_NB);

  /// Another reading, in the last picture, by which pictures have refuted the pose; or
  /// null.
  const OtherPose* better() const;
  /// Whether the pose may be another one, far from it.
  bool open() const { return open_; }

 private:
  struct Rival {
    std::array<std::uint16_t, kMaxLeds> instead{};  ///< By LED; 0: not seen yet.
    OtherPose pose;
    double evidence = 0;
    double leans = 0;  ///< What the way it would lean says for it.
    int pictures = 0;
    int unasked = 0;  ///< Pictures in a row that showed too few of its lights.
    Vector3 p_NB_base = Vector3::Zero();  ///< Where the pose was then.
    bool mirrored = false;                ///< The same LEDs.
    double for_it() const { return evidence + leans; }
  };
  bool follow(Rival& rival, const Camera& camera, const Constellation& leds,
              const LedFinder& plausible, ObservationSpan seen, const Pose& X_NB,
              double chi2);
  void add(const OtherPose& pose, ObservationSpan seen, const Pose& X_NB);
  double word(double chi2, double other_chi2) const;
  double leans(const Pose& other, const Pose& X_NB) const;
  bool apart(const Pose& a, const Pose& b) const;
  static unsigned leds_of(ObservationSpan seen);

  PoseDoubtConfig config_;
  FixedVector<Rival, 12> rivals_;
  std::optional<Push> push_;
  unsigned sure_ = 0;    ///< LEDs that are none other,
  unsigned looked_ = 0;  ///< and those that other readings were looked for with.
  bool open_ = false;
  unsigned pictures_ = 0;  ///< With these.
};

}  // namespace alight
