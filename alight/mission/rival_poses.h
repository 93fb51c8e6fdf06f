#pragma once
#include <span>
#include <vector>

#include "alight/estimation/relative_filter.h"
#include "alight/mission/motion_source.h"
#include "alight/vision/led_finder.h"
#include "alight/vision/led_tracker.h"

namespace alight {

struct RivalPosesConfig {
  int pictures_by_chance = 20;  ///< In which one that chance may explain must have.
  int pictures = 10;            ///< In which a pose must have explained the LEDs.
  double margin = 16;           ///< -2 log likelihood by which it must lead the others.
  double own_motion = 100;  ///< The same against lights that stand still, for a pose
                            ///< that chance may explain.
  double across_sd = 1.7;   ///< Wind pushes drones across by so much, m/s^2, as in
                            ///< PoseDoubtConfig;
  double leans_most = 24;   ///< how a pose leans speaks so far at most, -2 log
                            ///< likelihood.
  double remembers = 0.9;   ///< Share of the past that counts with each new picture:
                            ///< what a wrong rig does is the same in all of them.
  int misses_max = 2;       ///< In a row; then it is refuted.
  double turn_sd_max_deg = 12;       ///< Of a pose that is taken,
  double place_sd_max_share = 0.06;  ///< of its range from the lens.
  double silence_max_s = 0.3;        ///< Between pictures; then all begins anew.
};

/// Poses that a single picture could not tell apart, each followed by a filter of its
/// own until the pictures refute all but one. A mirrored or swapped pose predicts the
/// next picture wrongly once the drone moves; lamps that happen to stand like the LEDs
/// stay behind when it does. Fewer lights explained, and worse, count in each picture,
/// and so does how a pose leans that the way it flies does not bear out.
///
/// No allocation after `create`, at most `kMost` poses.
class RivalPoses {
 public:
  static constexpr std::size_t kMost = 8;

  /// @param filter  As it is used for the drone; copied.
  RivalPoses(const RivalPosesConfig& config, const Camera& camera,
             const RelativeFilter& filter);

  void clear();
  /// As of RelativeFilter.
  void set_rig(const Camera& camera, const RelativeFilter& filter);

  /// One picture more.
  /// @param fresh  What the finder left open in it.
  /// @returns the one that is left, with its correspondences in this picture, or
  ///          ambiguous (several, or too little seen yet), too_few_points (none).
  Result<FoundLeds> decide(BlobSpan blobs, Time t, std::span<const LedRival> fresh,
                           const LedTracker& tracker, const MotionSource& motion,
                           Time step);

 private:
  struct Rival {
    explicit Rival(const RelativeFilter& filter_in) : filter(filter_in) {}
    RelativeFilter filter;
    bool alive = false;
    bool by_chance = false;
    int pictures = 0;
    int misses = 0;
    double score = 0;  // -2 log likelihood by the lights, the lower the better;
    double last = 0;   // by those of the last picture that it explained,
    double fit = 0;    // and of that how many they are and how well they fit
    double leans = 0;  // the same by the way it leans
    double moved = 0;  // the same for lights that stand still, less the pose's own
    LedFrame seen;     // in the last picture
    double rms_px = 0;
    Matrix6 cov = Matrix6::Identity();
    double total() const { return score + leans; }
  };
  void follow(Rival& rival, BlobSpan blobs, Time t, const LedTracker& tracker,
              const MotionSource& motion, Time step);
  void add(const LedRival& fresh, BlobSpan blobs, Time t, const LedTracker& tracker);
  /// -2 log likelihood of these being its LEDs, how exact rig and pixels are unknown.
  double cost_of(const RelativeFilter& filter, const LedFrame& seen) const;
  Vector2 common_shift(BlobSpan blobs) const;
  void remember(BlobSpan blobs);
  Result<FoundLeds> verdict() const;

  RivalPosesConfig config_;
  Camera camera_;
  std::vector<Rival> rivals_;
  FixedVector<Vector2, kMaxBlobs> before_;  // the last picture's blobs
  std::vector<double> shift_u_, shift_v_;
  Vector2 shift_ = Vector2::Zero();
  Time last_ = 0;
};

}  // namespace alight
