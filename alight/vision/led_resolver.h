#pragma once
#include "alight/vision/led_tracker.h"
#include "alight/vision/light_share.h"
#include "alight/vision/picture_noise.h"
#include "alight/vision/skirt_learner.h"
#include "alight/vision/spot_fit.h"

namespace alight {

struct LedResolverConfig {
  bool use_color = true;
  double area_max_px = 60;     ///< Larger patches of one LED keep their centroid.
  double touch = 1.6;          ///< Images nearer than this many reaches of a light
                               ///< (spot_reach_px) are fitted together.
  double dim_reach_px = 1.2;   ///< An LED without a blob is at most this far off.
  double sd_floor_px = 0.008;  ///< No light's place is known better.
  double spread_sd_px = 0.9;   ///< Point spread of a camera not seen yet,
  double spread_share = 0.35;  ///< known to this share of its variance.
  double spread_memory = 100;  ///< Patches over which it is learnt.

  Result<void> validate() const;
};

/// Says where LEDs are that the tracker has told apart, from the pixels: lights that
/// run together are separated, small ones are placed better than by their centroid
/// above the threshold, and ones too dim for it are found where the others say they
/// must be. The camera's point spread is learnt on the way.
///
/// No allocation after construction.
class LedResolver {
 public:
  static Result<LedResolver> create(const LedResolverConfig& config,
                                    const Camera& camera, const Constellation& leds);

  /// Replaces the observations of every patch whose lights can be fitted; the others
  /// stay as they are, or go where several LEDs cannot be told apart in them. An LED
  /// that gives no light is left out.
  ///
  /// @param detail   Of the track() that made `frame` from `blobs`.
  /// @param blur_px  For each LED of the rig, its image's way during the exposure.
  void resolve(const ImageView& image, BlobSpan blobs, const TrackDetail& detail,
               std::span<const Vector2> blur_px, LedFrame& frame);

  /// The same without a tracker, from a good prediction: every LED is looked for where
  /// it is expected, `gate_px` around it at most, moved by what all have in common.
  /// Colours that speak against an LED are heeded.
  ///
  /// @returns nothing when the picture shows light nearby that no LED accounts for, a
  ///          light in an LED's place that is too large for one, or an LED less than
  ///          the last time: somebody else has to look.
  std::optional<LedFrame> follow(const ImageView& image, BlobSpan blobs,
                                 const Pose& X_NB_predicted, double gate_px,
                                 std::span<const Vector2> blur_px, Time t);

  /// The same among other lights, which cover some of the LEDs or run together with
  /// them: what is no LED by its colour, size or place is left out with all its pixels,
  /// and each LED stands for itself.
  ///
  /// @param cov       Of (dp_NB, dR in B) of the prediction. Nothing is looked for
  ///                  unless every image is known by it to kHoldSd px.
  /// @param slack_px  What LEDs are off besides, by an inexact rig.
  /// @returns the LEDs that are seen beyond doubt; may be empty.
  LedFrame hold(const ImageView& image, BlobSpan blobs, const Pose& X_NB_predicted,
                const Matrix6& cov, double slack_px, std::span<const Vector2> blur_px,
                Time t);
  static constexpr double kHoldSd = 1.5;

  const PointSpread& spread() const { return spread_; }

  /// The pictures from now on are so noisy, or as most are, if that is more.
  void set_noise(const PictureNoise& noise);

  /// Nothing covers part of a light in the picture looked at last.
  bool whole() const { return share_.whole() && area_share_.whole(); }

  /// Pictures from now on are as if another camera took them: how it draws lights, how
  /// bright they are and what colours they have is to be learnt again.
  void forget_lights();

  /// @pre as many LEDs as before.
  void set_rig(const Camera& camera, const Constellation& leds) {
    camera_ = camera;
    leds_ = leds;
  }

 private:
  struct Patch;
  using Patches = FixedVector<Patch, kMaxLeds>;
  struct Look;

  LedResolver(const LedResolverConfig& config, const Camera& camera,
              const Constellation& leds);
  /// LEDs that are looked for together; those that are dead and stand in others' light
  /// only without `left_out`, which receives whether there is any.
  Patches patches(const LedImages& images, BlobSpan blobs, const Assignment& match,
                  bool* left_out) const;
  /// Its pixels show more, or something else, than the lights looked for.
  bool unexplained(const Patch& patch) const;
  void remember_lit(std::uint16_t lit);
  void learn(const Patch& patch);
  void learn_color(int led, const LightColor& color);
  void learn_spread(const Patch& patch);
  void add(const Patch& patch, BlobSpan blobs, const Assignment& match,
           LedFrame& out) const;
  Look look_at(const ImageView& image, BlobSpan blobs, const Assignment& match,
               const LedImages& images, std::span<const Vector2> blur_px,
               int margin_px) const;
  /// Fits the patches for which `wanted` holds, each without the light of the others.
  template <class Wanted>
  void fit_all(Look& look, Patches& patches, Wanted&& wanted) const;
  /// The patches of a picture, those fitted for which `wanted` holds: without dead LEDs
  /// unless that leaves one of them unexplained.
  template <class Wanted>
  Patches fitted(Look& look, Wanted&& wanted) const;
  void fit(Look& look, Patch& patch) const;
  /// Members of a fitted patch, a bit each, that have not been seen the last time and
  /// are not where those that have been say: what noise makes of a light beside them.
  unsigned feigned(const Patch& patch, std::span<const LightSought> sought) const;
  /// Around one LED a picture: what the Gaussians leave there.
  void learn_skirt(const Look& look, const Patches& patches);
  void look_around(const Look& look, const Patches& patches, std::size_t led);
  void learn_from(const Look& look, const Patches& patches);
  /// How much of each light is seen: by its brightness, or a large one by its area.
  void compare_lights(const Look& look, const Patches& patches, const Pose& X_NB);
  /// What part of a large light that is covered does to its place, px^2.
  Matrix2 displacement(int led, const Blob& blob) const;
  /// An LED that has been told by its pixels, and is none by them now: something covers
  /// part of it, and what is left of it is not where it is.
  bool misshapen(const Patch& patch) const;
  /// A blob far larger than those of LEDs as bright as this one: what runs together
  /// with a lamp.
  bool outgrown(const Patch& patch, const Patches& patches) const;
  bool is_its_own(const Blob& blob, int led, const Vector2& blur_px) const;

  LedResolverConfig config_;
  Camera camera_;
  Constellation leds_;
  PointSpread spread_;
  std::array<double, kMaxLeds> heights_{};     // grey levels; 0: not known
  std::array<LightColor, kMaxLeds> colors_{};  // under a mosaic, each told by
  std::array<int, kMaxLeds> colors_seen_{};    // so many looks, at most kColorMemory
  LightShare share_, area_share_;
  std::uint16_t lit_ = 0;             // LEDs seen the last time
  std::array<int, kMaxLeds> dark_{};  // Pictures in a row in which they were not
  double noise_ = 1;                  // chi2 per pixel to be expected,
  double judged_ = 0;                 // from so many patches, at most spread_memory
  double known_ = 0;                  // patches learnt from, at most spread_memory
  SkirtLearner skirt_;
  int pictures_ = 0;
  std::size_t next_ = 0;  // LED around which the skirt is looked at next
};

}  // namespace alight
