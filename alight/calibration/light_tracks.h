#pragma once
#include <vector>

#include "alight/calibration/observed_frame.h"
#include "alight/geometry/rig.h"
#include "alight/vision/blob.h"

namespace alight {

/// One light followed through successive pictures, whichever LED it is.
struct LightTrack {
  struct Sight {
    Vector2 uv = Vector2::Zero();
    Matrix2 cov = Matrix2::Identity();
    int taken_for = -1;  ///< The LED that the picture alone took it for.
  };
  LedColor color = LedColor::none;
  int first = 0;            ///< Picture,
  std::vector<Sight> seen;  ///< and one sight for each from there on.

  int last() const { return first + static_cast<int>(seen.size()) - 1; }
  const Sight& at(int picture) const {
    return seen[static_cast<std::size_t>(picture - first)];
  }
};

/// Follows the lights of the drone from picture to picture by nothing but their motion
/// in the picture, which they share. Needs no LED positions: begins at lights in the
/// LEDs' colours, and at those about the drone where a picture shows it. A light whose
/// continuation is in doubt (run together with another, two equally near, none) ends
/// there and begins anew.
class LightTracks {
 public:
  explicit LightTracks(const Constellation& leds) : leds_(leds) {}

  /// The next picture. @param observed  What it shows of the drone; nullptr: unknown.
  void add(BlobSpan blobs, const ObservedFrame* observed);

  const std::vector<LightTrack>& tracks() const { return tracks_; }

 private:
  struct Followed {
    std::size_t track;
    Vector2 velocity = Vector2::Zero();  ///< px per picture
  };
  Vector2 expected(const Followed& f) const;
  Vector2 common_shift(BlobSpan lights) const;
  void follow(BlobSpan lights, std::vector<bool>& used);
  void begin(BlobSpan lights, const ObservedFrame* observed,
             const std::vector<bool>& used);

  Constellation leds_;
  int picture_ = -1;
  std::vector<Followed> followed_;
  std::vector<LightTrack> tracks_;
};

}  // namespace alight
