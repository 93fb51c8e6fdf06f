#pragma once
#include "alight/vision/blob.h"
#include "alight/vision/led_matcher.h"
#include "alight/vision/pose_from_leds.h"

namespace alight {

struct LedTrackerConfig {
  enum class Profile {
    standard,
    paper  ///< Shift by the difference of the centres, then the nearest neighbour.
  };
  Profile profile = Profile::standard;
  bool use_color = true;
  double shift_sd_px = 6;     ///< Common displacement beyond what `cov` says.
  double scale_sd = 0.06;     ///< Error of the predicted size of the constellation.
  double turn_sd_deg = 3;     ///< Error of the predicted rotation in the picture.
  double gate_sd = 3;         ///< How many of each are looked for.
  double match_px = 3;        ///< Residual up to which a blob is an LED's, plus
  double match_share = 0.03;  ///< this share of the constellation's size in px,
  double led_sd_m = 0.002;    ///< plus what LEDs that are off by this sd do.
  double merge_px = 6.5;      ///< LEDs whose images are closer may share a blob.
  double merged_imbalance = 0.15;  ///< sd of the weight of one LED in a merged blob.
  double roi_margin_px = 12;
  double paper_gate_px = 20;  ///< paper: farther neighbours are none.

  Result<void> validate() const;
};

/// What the tracker saw on its way to an answer.
struct TrackDetail {
  LedImages images;  ///< Where the pose that it came to puts the LEDs.
  Assignment match;
  Pose X_NB_predicted = Pose::Identity();
  Matrix6 prior_information = Matrix6::Zero();  ///< About it, generous.
};

/// Follows the LEDs from a predicted pose (paper: correspondence tracking). Stateless:
/// the same call gives the same answer.
class LedTracker {
 public:
  static Result<LedTracker> create(const LedTrackerConfig& config, const Camera& camera,
                                   const Constellation& leds);

  /// Which blob shows which LED. Never more than one observation a LED; an LED that is
  /// not seen is missing from the answer, which may be empty.
  /// @param cov  Of (dp_NB, dR in B) of the prediction.
  LedFrame track(BlobSpan blobs, const Pose& X_NB_predicted, const Matrix6& cov,
                 Time t = 0, TrackDetail* detail = nullptr) const;

  /// A rig that has been measured, to `led_sd_m`, takes the place of the one written
  /// down. @pre as many LEDs as before.
  void set_rig(const Camera& camera, const Constellation& leds, double led_sd_m) {
    set_rig(camera, leds);
    config_.led_sd_m = led_sd_m;
  }
  /// As above, known as well as before.
  void set_rig(const Camera& camera, const Constellation& leds) {
    camera_ = camera;
    leds_ = leds;
  }

  /// Part of the picture that holds the LEDs; empty when the prediction lies outside.
  Roi roi(const Pose& X_NB_predicted, const Matrix6& cov) const;

 private:
  LedTracker(const LedTrackerConfig& config, const Camera& camera,
             const Constellation& leds)
      : config_(config), camera_(camera), leds_(leds) {}

  LedFrame track_paper(BlobSpan blobs, const Pose& X_NB, Time t) const;

  LedTrackerConfig config_;
  Camera camera_;
  Constellation leds_;
};

}  // namespace alight
