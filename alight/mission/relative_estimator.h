#pragma once
#include "alight/estimation/led_errors.h"
#include "alight/estimation/led_learner.h"
#include "alight/estimation/relative_filter.h"
#include "alight/estimation/rest_association.h"
#include "alight/estimation/rest_calibration.h"
#include "alight/estimation/rest_images.h"
#include "alight/mission/landing_io.h"
#include "alight/mission/motion_source.h"
#include "alight/mission/pose_doubt.h"
#include "alight/mission/rival_poses.h"
#include "alight/vision/blob_detector.h"
#include "alight/vision/gamma_learner.h"
#include "alight/vision/led_finder.h"
#include "alight/vision/led_resolver.h"
#include "alight/vision/led_tracker.h"
#include "alight/vision/linear_picture.h"
#include "alight/vision/pad_mirror.h"
#include "alight/vision/picture_repeat.h"
#include "alight/vision/stray_memory.h"

namespace alight {

struct RelativeEstimatorConfig {
  BlobDetectorConfig blobs;
  bool heed_noise = true;  ///< In pictures noisier than most, fewer pixels are lights.
  LedFinderConfig finder;
  LedTrackerConfig tracker;
  bool tell_apart = true;  ///< Place LEDs by their pixels, not by their blob's centre.
  LedResolverConfig resolver;
  double placed_within_m = 0.15;  ///< Pixels may move a found pose this far
  double placed_within_deg = 12;  ///< and turn it this much.
  double placed_sd_px = 0.1;      ///< How exact pixels place LEDs. A pose found that
  double placed_sds = 3;          ///< fits worse than so many sd must be confirmed, and
                                  ///< is none if the LEDs' own do not explain it.
  double direct_gate_px = 2.5;    ///< LEDs this near to where they are expected are
                                  ///< followed without looking further.
  std::size_t held_leds = 4;      ///< So many told one by one among lamps do without
                                  ///< the tracker.
  RelativeFilterConfig filter;
  bool learn_led_errors = true;  ///< Where LEDs are, beside the state, from each
                                 ///< picture of enough of them to tell.
  LedErrorsConfig errors;
  bool learn_leds = false;  ///< Where LEDs are, once residuals show them to be off by
  double learn_leds_from_m = 0.0003;  ///< this much (sd).
  LedLearnerConfig learner;
  RestCalibrationConfig rest;
  bool keep_rivals =
      true;  ///< Poses that one picture cannot tell apart, until more do.
  RivalPosesConfig rivals;
  PoseDoubtConfig doubt;    ///< With tell_apart.
  bool learn_gamma = true;  ///< How the camera stores light, unless the rig tells it;
  int suppose_gamma_after = 0;  ///< and until that is known: after so many pictures in
                                ///< which nothing is found, and as many again, one is
                                ///< searched as if light were stored by the usual power
                                ///< of it, too. 0: never.
  bool calibrate_at_rest = true;   ///< Before take-off from the pad.
  int rest_pictures = 20;          ///< That many of each LED at least.
  double rest_led_sd_m = 0.0008;   ///< How well LEDs are known then.
  double prediction_step_ms = 5;   ///< Inputs are held this long.
  int frozen_pictures = 0;         ///< So many alike to the last bit in a row are those
                                   ///< of a camera that has stopped: no sight, where
                                   ///< the drone flies or pictures have differed while
                                   ///< it stood. 0: not looked at.
  bool told_when_it_rests = true;  ///< Else it flies while it is seen to move.
  // Fewer than three LEDs do for a pose that is known this well (sd) with them:
  double known_sd_m = 0.05;
  double known_sd_deg = 7;
  double known_sd_m_s = 0.2;     ///< Speed is known, after the LEDs were lost.
  double found_sd_m_s = 1;       ///< A drone found anew, each direction.
  double reckoned_sd_m_s = 0.3;  ///< Of a velocity that the autopilot tells, each time:
                                 ///< its errors last for many of them.
  bool tell_led_frame = false;   ///< The rig's `led_frame` counts in what is told.
  double coast_s = 0;            ///< So long a pose that is known well goes on being
                                 ///< told where pictures show too little of it.
  double told_sd_m = 0;          ///< A pose that is less well known (sd) in some
  double told_sd_deg = 0;        ///< direction, with what LEDs do to it that may be
                                 ///< off, is not told. 0: all are.
  int misses_before_search = 3;  ///< Frames without a match before the whole picture
                                 ///< is searched,
  int leds_after_misses = 4;     ///< and LEDs needed to be taken up again from then,
  int lights_after_misses = 2;   ///< among so many lights for each LED at most.
  // LEDs that are lost may have been covered in part before: the prediction goes on
  int sound_leds = 3;               ///< from when so many were last seen well,
  double sound_s = 0.5;             ///< if that is not longer ago.
  double forget_after_s = 2;        ///< Prediction alone is believed this long.
  double reprojection_max_px = 4;   ///< A worse fit counts as a miss.
  double search_gate_m = 0.5;       ///< A search's answer this near to the prediction
                                    ///< keeps the predicted velocity.
  double expected_within_m = 0.1;   ///< An answer so near to the prediction in place
  double expected_within_deg = 10;  ///< and turn need not be exact.
  // An answer that contradicts the prediction may be made of lamps.
  double search_drift_m_s = 1;  ///< A prediction may be off by the gate plus this,
  double search_turn_deg = 35;  ///< and turned by this;
  double search_lean_deg = 20;  ///< but lean no more from where its thrust is known to
                                ///< point. 180: that is not known;
  // Since it was followed beyond doubt a drone comes no farther from the prediction, or
  // from where it was; what looks like it elsewhere is another one.
  double reach_m = 0.15;
  double reach_m_s = 0.3;        ///< And so much a second. 0: that is not known;
  int search_leds = 5;           ///< else an answer needs that many LEDs,
  double search_rms_px = 0.25;   ///< at least as exactly as this,
  double search_rms_factor = 3;  ///< or as this many times what is usual,
  int search_confirmations = 3;  ///< in so many pictures in a row.
  double floor_tilt_deg = 20;    ///< From the floor: an answer must be confirmed, too,
  double floor_height_m = 1;     ///< not tilted more, not higher above the pad.

  Result<void> validate() const;
  static RelativeEstimatorConfig paper();
  /// Pictures alone, nothing known of set-points or platform: for recorded pictures.
  static RelativeEstimatorConfig camera_only();
};

/// From pictures to the relative state (paper, sec:RSE): detect, find or follow the
/// correspondences, filter. Each picture is fused at its time of capture.
///
/// No clock and, after `create`, no allocation.
class RelativeEstimator {
 public:
  static Result<RelativeEstimator> create(const RelativeEstimatorConfig& config,
                                          const Rig& rig);

  /// Fuses one picture. `out` tells what became of it; a picture that is older than
  /// the last or damaged changes nothing (`out.why_not`).
  /// @returns false when the picture was refused as such.
  bool fuse(const CameraFrame& frame, const MotionSource& motion, FrameReport& out,
            Probe* probe = nullptr);

  /// Carries the filter on to `t` without a picture: what moved the drone is only known
  /// for a while (DroneResponse::kHistory). Pictures from before `t` are lost to it.
  void advance(Time t, const MotionSource& motion);

  /// The velocity of a drone that is not seen, as its autopilot tells it
  /// (DeadReckoning): the filter is carried on to `t`, as by `advance`. Pictures may
  /// have carried it further already: one of up to 0.25 s before counts with what has
  /// accelerated the drone since, an older one changes nothing.
  void reckon(Time t, const Vector3& v_NB, const MotionSource& motion);

  /// Images of the picture just fused, as a rolling shutter would have them that had
  /// exposed all of the drone at once, with its middle; of a global one as they are.
  LedFrame seen_at_once(const LedFrame& leds) const;

  bool initialized() const { return filter_.initialized(); }
  /// Capture time of the last picture that was tracked; only when initialized.
  Time last_sight() const { return last_sight_; }
  const RelativeFilter& filter() const { return filter_; }
  /// By what power the camera is taken to store light (Rig::gamma).
  double gamma() const { return linear_.gamma(); }
  /// The last picture repeated those before to the last bit,
  bool picture_repeats() const { return repeats_; }
  /// as those of a camera that still looks would not.
  bool camera_frozen() const { return frozen_; }

  /// State carried to `t` (any time at or after the last picture), inputs by `motion`.
  /// `cov`, when given, receives the covariance. @pre initialized().
  MotionState carried_to(Time t, const MotionSource& motion,
                         Covariance9* cov = nullptr) const;
  /// Goes on from an earlier answer.
  MotionState carried_on(MotionState from, Time t_from, Time t,
                         const MotionSource& motion) const;

  /// What accelerates the drone, the model does not know it from here on, and what was
  /// learnt before is forgotten: by the wind, d_N, and with N, b_N (MotionState).
  void restart_disturbance(const Vector3& d_N, const Vector3& b_N);
  void forget() {
    filter_.stop();
    forget_past();
  }

  /// What is followed, in the picture of `t` there, is another drone, with the same
  /// LEDs: forgotten, and not found again where it is.
  void refuse(const Pose& X_NB, Time t);

  /// Where the drone stands, roughly, while nothing else is known of it: a search that
  /// finds no single answer is decided by it. `cov` of (dp_NB, dR in B).
  void expect(const Pose& X_NB, const Matrix6& cov);
  void expect_nothing() { expecting_ = false; }

  /// While it stands on the floor or has just left it, a pose is only believed if the
  /// drone is upright and low in it, picture after picture: a light that is taken for
  /// the drone would be climbed after.
  void set_on_floor(bool on_floor) { on_floor_ = on_floor; }

  /// Measures the rig by the drone that stands where it is expected, from the pictures
  /// since `expect`, and goes on with the rig as found.
  /// @returns too_few_points (not seen for long enough), or the complaint of
  ///          alight::calibrate_at_rest; then the rig stays as written.
  Result<RestFit> calibrate_at_rest();

 private:
  /// So many LEDs leave more of their images' errors than the pose takes up by chance.
  static constexpr std::size_t kTellingLeds = 5;
  /// So many lights in the colours of their LEDs are no lamps; nor are white ones that
  /// fit exactly and are so many.
  static constexpr int kColored = 3;
  static constexpr std::size_t kNoLamps = 6;

  RelativeEstimator(const RelativeEstimatorConfig& config, const Rig& rig,
                    BlobDetector detector, LedFinder finder, LedTracker tracker,
                    LedResolver resolver, RelativeFilter filter);
  /// Since the last sight, be it that no picture came.
  bool unseen_for_long(Time t) const;
  /// The LEDs were lost before the picture of `t`.
  bool missed(Time t) const;
  /// Whether what has been told until just now goes on being known.
  bool coasts(Time t) const;
  /// Surely, by what the filter knows.
  bool moves() const;
  /// Lights that are none of the LEDs stand about where X_NB has these.
  bool among_lamps(const LedFrame& seen, const Pose& X_NB) const;
  /// So few LEDs seen again may be lamps, until pictures in a row show them.
  bool to_be_confirmed() const;
  /// The last picture shows enough LEDs, as they were expected and nothing before them.
  bool seen_soundly() const;
  /// The LEDs just seen fit no other pose.
  bool no_doubt(const FrameReport& out) const;
  /// The filter as it was once, carried to `t`; what was learnt of the rig stays.
  void go_back_to(const RelativeFilter& then, Time t, const MotionSource& motion);
  void forget_past();
  /// @returns whether the filter goes on from a pose that was found.
  /// Nothing explains the lights by the LEDs as they have been learnt: they stand
  /// again as written, once that has lasted.
  void doubt_learnt_leds(const FrameReport& out);
  bool search(const CameraFrame& stored, const MotionSource& motion, FrameReport& out,
              Probe* probe, bool only_certain = false);
  /// The same, and now and then as if the camera stored light by the usual power of it.
  void search_either_way(const CameraFrame& stored, const MotionSource& motion,
                         FrameReport& out, Probe* probe);
  /// A pose found from blobs, made as exact as the pixels allow.
  /// @returns false where they speak against one of its LEDs; it stays as it was.
  bool place_by_pixels(const CameraFrame& frame, BlobSpan blobs, FoundLeds& found);
  /// Of six lights or more that fit badly, more than three of them in their LEDs'
  /// colours, leaves out the one without which the others fit to `placed_sd_px`, if
  /// there is one: an LED that runs together with a lamp.
  void leave_out_misfit(FoundLeds& found) const;
  /// Lights that a pose fits so well, rms, stand as exactly as LEDs do.
  bool exact(double rms_px) const {
    return rms_px <= config_.placed_sds * config_.placed_sd_px;
  }
  bool exact(const FoundLeds& found) const {
    return !config_.tell_apart || exact(found.fit.rms_px);
  }
  /// Enough LEDs, seen as exactly as LEDs are.
  bool beyond_doubt(const Result<FoundLeds>& found) const;
  /// What a search of one picture says, and what the LEDs it finds there teach.
  struct Answer {
    Result<FoundLeds> found;
    LedResolver learnt;
  };
  /// Of what bright lights alone and dim ones, too, say.
  Answer better(const Answer& bright, const Answer& dim) const;
  using Rivals = FixedVector<LedRival, RivalPoses::kMost>;
  /// Of poses that blobs leave open the one whose pixels show it beyond doubt: enough
  /// lights stand there exactly, and plainly more than for any other that fits nearly
  /// as well. What its LEDs teach is kept, what the others do is not.
  std::optional<FoundLeds> told_by_pixels(const CameraFrame& frame, BlobSpan blobs,
                                          const Rivals& open);
  /// In a whole picture, from what stands out in it, `blobs`, to what takes more
  /// looking.
  /// @param blobs  Replaced by the lights as they are known in the end.
  /// @param open   Left open where nothing is found.
  Result<FoundLeds> find_anywhere(const CameraFrame& frame, bool at_rest,
                                  BlobSpan& blobs, Rivals& open);
  /// Poses by which so few LEDs, placed by their pixels, may be others of their
  /// colours, the one found among them; empty if it stands alone. One that fits far
  /// better takes its place.
  Rivals rivals_of(FoundLeds& found) const;
  /// So few LEDs fit far better as others of their colours, elsewhere.
  bool misread(const FoundLeds& found) const;
  /// Worst fit of pixels that LEDs as far as they may be off explain.
  double placed_rms_max_px(const Pose& X_NB) const;
  /// Worst fit of a drone that stands where it is expected, by the lens, with LEDs that
  /// are off as far as they may be: there that is many pixels.
  double rest_rms_max_px(const Pose& X_NB) const;
  void go_on_from(const FoundLeds& found, Time t, FrameReport& out);
  /// The filter has been set: nothing that was before counts any more.
  void start_from(const FoundLeds& found, Time t, FrameReport& out);
  /// Where LEDs stay unseen, they may be taken for one another: whether a pose that
  /// explains more of them is far from the one followed. Seen in several pictures in a
  /// row, it takes its place.
  bool contradicted(const CameraFrame& stored, FrameReport& out, Probe* probe);
  /// Few LEDs are held against what they may be besides.
  void doubt(FrameReport& out);
  bool believable(const FoundLeds& found, Time t);
  /// The drone may have come there since there was no doubt where it was.
  bool within_reach(const Pose& X_NB, Time t) const;
  bool forgotten_in_flight() const;
  /// The other drone is there.
  bool is_other(const Pose& X_NB, Time t);
  bool leans_as_known(const Matrix3& R_NB) const;
  bool believable_on_floor(const FoundLeds& found);
  bool confirmed(const Pose& X_NB);
  bool follow(const CameraFrame& stored, FrameReport& out, Probe* probe);
  bool follow_among(BlobSpan blobs, const CameraFrame& frame, FrameReport& out,
                    Probe* probe);
  /// Updates the filter and tells of it. Nothing happens unless `agreeing` observations
  /// agree with the prediction and the fit is as exact as `rms_max_px`.
  bool accept(const LedFrame& leds, std::size_t agreeing, double rms_max_px,
              FrameReport& out, Probe* probe);
  bool well_known() const;
  /// A fit of LEDs is at least so exact, as far as has been seen, for a drone there:
  /// what LEDs are off by shows the more the nearer they are.
  double exact_px(const Vector3& p_NB) const;
  double usual_rms_px(const Vector3& p_NB) const;
  /// LEDs that fit worse contradict one another; 0: that is not known yet.
  double misfit_max_px() const;
  double lens_distance(const Vector3& p_NB) const;
  /// The LEDs of a drone that stands where it is expected, looked for around `X_NB`
  /// (`cov` of dp_NB, dR in B): a fit with all but one of them in view.
  Result<FoundLeds> find_expected(BlobSpan blobs, Time t, const Pose& X_NB,
                                  const Matrix6& cov) const;
  bool stands_as_expected(const Pose& X_NB) const;
  /// Tells the LEDs of a drone that stands where it is expected, at least so many of
  /// them, by all that may be off, and goes on from there with the rig as they show it.
  /// @returns false, with nothing changed, where they cannot be told beyond doubt.
  bool start_at_rest(BlobSpan blobs, Time t, int leds_least, FrameReport& out);
  Result<RestFit> find_at_rest(BlobSpan blobs, int leds_least, LedFrame& frame) const;
  /// The rig as a drone at rest has shown it, and the drone.
  void take_rest(const RestFit& fit, int leds_seen, Time t);
  /// All that are not the twins of brighter ones in a glossy pad. Valid until the next
  /// call.
  BlobSpan without_twins(BlobSpan blobs);
  /// Way of each LED's image during the exposure, px.
  FixedVector<Vector2, kMaxLeds> image_motion(const Pose& X_NB) const;
  /// When a rolling shutter sees the middle of a drone there, after the picture's time.
  Seconds delay_of(const Pose& X_NB) const;
  /// The filter to when the drone is seen: in between, it is meant by all that looks.
  void shift_to_drone(Time t, const MotionSource& motion);
  /// And back to the picture's time.
  void shift_back(Time t, const MotionSource& motion);
  void report_state(FrameReport& out) const;
  void remember_rest(const LedFrame& leds);
  /// What is never known well enough may be LEDs taken for others: all that they seemed
  /// to teach is forgotten, and they are searched for.
  void begin_anew();
  void remember_fit(int leds, double rms_px);
  bool would_jump(const LedFrame& leds) const;
  void learn_leds(const LedFrame& leds, const UpdateReport& report);
  /// The pose that the LEDs as written show, in picture after picture far more exactly
  /// than those that have been learnt: from lights that were none of them.
  std::optional<PoseFit> written_fits_better();
  /// From a picture as the camera has stored it, with what has been seen in it.
  void learn_gamma(const ImageView& stored, const FrameReport& out);
  /// From here on pictures are taken to be stored like that.
  void take_gamma(double gamma);
  /// What picks lights heeds the picture's noise from here on.
  void set_noise();
  void learn_led_errors(const LedInformation& told, Time t);
  /// The LEDs as learnt, for all that look for them.
  void take_leds(const Constellation& leds, const LedCovariance& cov);

  RelativeEstimatorConfig config_;
  Time step_;
  Camera camera_;
  Constellation leds_;
  Camera camera_written_;
  Constellation leds_written_;
  Mosaic mosaic_;
  Seconds exposure_, readout_;
  Seconds delay_ = 0;                 // of the picture that is looked at
  Vector3 w_NB_B_ = Vector3::Zero();  // then
  LinearPicture linear_;
  GammaLearner gamma_learner_;
  PictureNoise noise_;   // of the picture as stored
  int unfound_ = 0;      // searches in a row without a pose
  int unexplained_ = 0;  // of those, the last ones of lights that would do for one
  BlobDetector detector_;
  LedFinder finder_;
  LedTracker tracker_;
  LedResolver resolver_;
  RelativeFilter filter_;
  RivalPoses rivals_;
  PoseDoubt doubt_;
  FixedVector<LedObservation, kMaxLeds> seen_;  // last, each of one LED,
  std::size_t seen_alone_ = 0;                  // and how many of them stand alone
  LedErrors errors_;
  Time last_told_of_leds_ = 0;
  LedLearner learner_;
  int misfits_ = 0;          // pictures in a row whose residuals show LEDs to be off
  bool learning_ = false;    // they have shown it
  int steps_ = 0;            // that the learner still is to make
  int written_better_ = 0;   // pictures in a row that what it learnt fits far worse
  bool leds_moved_ = false;  // finder and rivals do not know of it yet
  // Of fits to five LEDs and more, rms times distance, px m: LEDs that are not where
  // the rig says misfit by more pixels the nearer they are. 0: not known.
  double usual_misfit_ = 0, misfit_least_ = 0;
  double misfit_ = 0, fits_ = 0;       // as they were, and of how many
  double fitted_misfit_ = 0;           // the lesser one of the last two fits,
  double last_misfit_ = 0;             // and that of the last,
  int fitted_leds_ = 0;                // which was to so many
  Vector3 lift_N_ = Vector3::UnitZ();  // where its thrust points
  PictureRepeat repeat_;
  bool repeats_ = false, frozen_ = false;  // the last picture
  int unlike_ = 0;                         // in a row
  bool noisy_ = false;                     // pictures of what stands differ
  Time last_frame_ = INT64_MIN;
  Time last_sight_ = 0;
  struct Seen {
    Pose X_NB = Pose::Identity();
    Time t = 0;
  };
  std::optional<Seen> beyond_doubt_;  // last, of this flight
  std::optional<Seen> other_;         // another drone, last
  Time last_told_ = 0;                // or last found
  int misses_ = 0;
  bool fresh_ = false;        // just found, its speed is not known yet
  bool found_again_ = false;  // the same, after it was lost
  int taken_up_ = 0;  // pictures in a row with few LEDs seen again, not yet confirmed
  // As it was before a picture that may be refused, before those few, and when LEDs
  // were last seen well.
  std::optional<RelativeFilter> before_update_, before_taken_up_, sound_;
  int contradictions_ = 0;  // pictures in a row
  int doubts_ = 0;          // pictures in a row with LEDs missing
  int confirmations_ = 0;   // of the answer that contradicts the prediction
  Pose X_NB_contrary_ = Pose::Identity();
  bool on_floor_ = false;
  bool expecting_ = false;
  Pose X_NB_expected_ = Pose::Identity();
  Matrix6 cov_expected_ = Matrix6::Identity();
  Pose X_NB_rest_ = Pose::Identity();  // there, once measured, else where expected
  bool rig_measured_ = false;          // on the pad
  int rest_leds_ = 0;                  // by so many of them
  unsigned incomplete_ = 0;            // pictures since then, if not by all
  PadMirror mirror_;
  StrayMemory strays_;
  bool sure_ = false;           // since it was found LEDs enough left no doubt
  bool ignores_twins_ = false;  // while it expects
  FixedVector<Blob, kMaxBlobs> no_twins_, apart_;
  RestImages rest_images_;
};

}  // namespace alight
