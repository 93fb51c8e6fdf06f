#pragma once
#include "alight/peers/led_voting.h"
#include "alight/peers/peer.h"
#include "alight/vision/blob_detector.h"

namespace alight {

/// "paper": M. Faessler, E. Mueggler, K. Schwabe, D. Scaramuzza, A Monocular Pose
/// Estimation System based on Infrared LEDs, ICRA 2014. "manual": the defaults that the
/// authors publish for their program's settings. "ours": neither decides it. "tuned":
/// the best of eight settings on six rendered flights of the authors' rig with rig
/// errors, where the manual's values lose half of the frames: 20 mm between LEDs are
/// 4 px at 2 m, and three LEDs nearly in a line give poor poses.
struct KfLessConfig {
  BlobDetectorConfig blobs = [] {
    BlobDetectorConfig config;
    config.smooth = false;           // tuned: smoothing joins LEDs that are near
    config.grey_threshold = 100;     // tuned: likewise
    config.depth_threshold_m = 2.5;  // ours: the landing paper cuts by depth first
    config.area_min_px = 2;          // ours: an LED at 3 m (manual: 10)
    config.area_max_px = 200;        // manual
    return config;
  }();
  double width_height_max = 0.5;  ///< manual: of a blob, off 1 by at most this.
  double circle_max = 0.5;        ///< manual: area over that of its circle, likewise.
  double shape_area_px = 16;      ///< ours: a smaller patch has no shape.
  /// tuned: back projection 5 px (manual: 3) and valid correspondences 0.4 (manual:
  /// 0.7); manual: certainty 0.75.
  LedVotingConfig voting{
      .back_projection_px = 5, .certainty = 0.75, .valid_share = 0.4};
  double nearest_px = 5;  ///< manual: a predicted LED's light is at most so far off.
  double huber_px = 2;    ///< ours: the paper's Gauss-Newton weights all alike.
  double sd_px = 1;       ///< ours: a detection is good to a pixel, each axis.
  double rms_max_px = 3;  ///< ours: a worse fit is none, as a back projection.
  /// ours: the search takes the third power of it. Of more lights those nearest to the
  /// last pose are looked at, without one the brightest.
  int search_lights_max = 16;
  double predict_max_s = 0.5;  ///< ours: older motion says nothing.
  double roi_margin_px = 30;   ///< ours: around the predicted LEDs.

  Result<void> validate() const;
};

/// Every pose is a fit to one picture, nothing is filtered: the landing paper's
/// "KF-less". Correspondences by voting; then from the pose predicted with constant
/// velocity the nearest lights; a new search as soon as that fails.
class KfLess final : public Peer {
 public:
  static Result<std::unique_ptr<Peer>> create(const KfLessConfig& config,
                                              const Rig& rig);
  PeerReport fuse(Time t, const ImageView& color, const DepthView& depth) override;

 private:
  KfLess(const KfLessConfig& config, const Rig& rig, BlobDetector detector);

  struct Sight {
    Time t = 0;
    Pose X_NB = Pose::Identity();
  };
  bool predict(Time t, Pose& X_NB) const;
  void see(BlobSpan blobs, PeerReport& out);
  bool follow(const Pose& X_NB, PeerReport& out);
  bool search(PeerReport& out);
  bool fit(const LedMatches& matches, const Pose& X_NB_0, PeerReport& out) const;
  Roi roi(const Pose& X_NB) const;
  void keep_nearest(std::size_t count);

  KfLessConfig config_;
  Camera camera_;
  Constellation leds_;
  BlobDetector detector_;
  LedVoting voting_;
  Lights lights_;  // of this picture
  std::vector<double> brightness_;
  Sight last_, before_;
  int sights_ = 0;  // in a row, up to 2
  bool ever_ = false;
};

}  // namespace alight
