#pragma once
#include <memory>
#include <span>
#include <vector>

#include "alight/vision/blob_detector.h"
#include "alight/vision/pose_from_leds.h"

namespace alight {

struct LedFinderConfig {
  enum class Profile {
    standard,  ///< Strays, missing and merged LEDs, colour or not.
    paper      ///< algo:RSE_INIT: as many blobs as LEDs, MAD test, all orders, EPnP.
  };
  Profile profile = Profile::standard;
  bool use_color = true;
  // Where a drone can be: the search knows nothing else of it.
  double range_min_m = 0.2;  ///< From the lens.
  double range_max_m = 6;
  double tilt_max_deg = 60;    ///< Of B's z axis from N's.
  double tilt_sd_deg = 15;     ///< What is usual; weighs between poses that fit alike.
  double facing_max_deg = 90;  ///< Between the LEDs' side of the drone and the lens,
                               ///< in the horizontal plane; 180 switches it off.
  bool pad_hides = false;      ///< Nothing is seen through the pad: what a pose there
                               ///< explains are images in it.
  // When an answer is taken.
  double rms_max_px = 2;        ///< Or three sd of what is expected, if that is more.
  double led_sd_m = 0.002;      ///< How well LED positions are known, per axis.
  double centroid_sd_px = 0.2;  ///< Added to the blobs' own, for what noise leaves out.
  double merge_px = 6.5;        ///< LEDs whose images are closer may share a blob.
  double missing_cost = 8;      ///< -2 log of the chance that an LED is not seen,
  double mirror_cost = 8;       ///< that a brighter light of its colour stands just
                                ///< where the pad would show it as this LED.
  double brightness_sd = 1;     ///< Of the logarithm of an LED's brightness; one LED
                                ///< costs no more by it than mirror_cost.
  double runner_up_margin = 8;  ///< -2 log likelihood by which it must beat its rival.
  double attitude_sd_max_deg = 7;  ///< The answer's own, about its worst axis.
  /// Accept only if fewer answers as good are expected by chance of lights that have
  /// nothing to do with the drone.
  double false_alarms_max = 0.1;
  int work_max = 200000;     ///< Bound on the work for one picture, 10 to 30 ns each,
                             ///< and as much again where white may be any colour; of
                             ///< more than six LEDs so much more of it.
  double mad_limit_m = 0.1;  ///< paper: lambda_MAD of eqn:RSE_mad.

  Result<void> validate() const;
};

/// LEDs found without a prior.
struct FoundLeds {
  LedFrame frame;
  PoseFit fit;
  int in_color = 0;            ///< Lights in the colour of their LEDs.
  double score = 0;            ///< -2 log likelihood, against all being stray lights.
  double runner_up_score = 0;  ///< Of the best rival pose.
  bool another = false;        ///< Other lights look as much like the drone.
};

/// A pose that one picture could not tell from others, or from chance.
struct LedRival {
  Pose X_NB = Pose::Identity();
  Matrix6 cov = Matrix6::Identity();  ///< Of (dp_NB, dR in B).
  int blobs = 0;                      ///< That it explains.
  bool by_chance = false;  ///< Lights that have nothing to do with the drone may do so.
};

/// Solves correspondence and pose at once from the blobs of one picture (paper:
/// initialization).
class LedFinder {
 public:
  enum class Look {
    glance,   ///< For a drone that shows five LEDs or more in their colours.
    thorough  ///< For four, too, and for LEDs washed out to white.
  };

  /// @param pad_size_m  Side of the pad, which may be glossy; 0: nothing mirrors.
  static Result<LedFinder> create(const LedFinderConfig& config, const Camera& camera,
                                  const Constellation& leds, double pad_size_m = 0);
  LedFinder(LedFinder&&) noexcept;
  LedFinder& operator=(LedFinder&&) noexcept;
  ~LedFinder();

  /// A rig that has been measured, to `led_sd_m`, takes the place of the one written
  /// down, to which it must be near. @pre as many LEDs as before.
  void set_rig(const Camera& camera, const Constellation& leds, double led_sd_m);

  /// @returns too_few_points (no pose explains enough LEDs), ambiguous (two do about
  ///          equally well); paper: too_few_points when blobs and LEDs differ in
  ///          number, degenerate when the MAD test fails.
  Result<FoundLeds> find(BlobSpan blobs, Time t = 0, Look look = Look::thorough);

  /// Whether a drone can be there, by the config's range, tilt and facing.
  bool plausible(const Pose& X_NB) const;

  /// What the last `find` left open when it gave no answer, best first; more pictures
  /// decide between them.
  std::span<const LedRival> left_open() const;

 private:
  struct Search;
  explicit LedFinder(std::unique_ptr<Search> search);
  std::unique_ptr<Search> search_;
};

/// Everything one picture says: for `alight detect`.
struct DetectResult {
  std::vector<Blob> blobs;
  Result<FoundLeds> found = fail(Fault::too_few_points);
};

/// Detects and finds in one picture, on its own.
/// @returns the configs' complaint, or invalid_input of the picture. That no pose is
///          there is told in `found`.
Result<DetectResult> detect_once(const Rig& rig, const ImageView& image,
                                 const DepthView& depth = {},
                                 const BlobDetectorConfig& blob_config = {},
                                 const LedFinderConfig& finder_config = {});

}  // namespace alight
