#pragma once
#include <Eigen/Core>
#include <array>
#include <span>

#include "alight/base/fixed_vector.h"
#include "alight/estimation/led_information.h"
#include "alight/geometry/led_frame.h"
#include "alight/geometry/rig.h"

namespace alight {

struct LedLearnerConfig {
  double led_sd_m = 0.002;      ///< Of each coordinate as written, to begin with,
  double led_sd_max_m = 0.004;  ///< and at most, whatever pictures say.
  double pixel_sd_px = 0.05;    ///< Added to the images' own, for what these leave out.
  double turn_deg = 4;  ///< Kept pictures differ by so much in the side they show,
  double nearer = 0.7;  ///< or replace one from farther by this factor.

  Result<void> validate() const;
};

/// Learns from pictures of several sides of the drone how its LEDs really stand to each
/// other: LED positions and the poses of some pictures together, the most probable
/// given the images and the positions written down (bundle adjustment, poses
/// eliminated). Place, turn and size of the constellation as a whole stay as written:
/// the camera cannot tell.
///
/// No allocation; a step costs some ten microseconds.
class LedLearner {
 public:
  LedLearner(const LedLearnerConfig& config, const Camera& camera,
             const Constellation& nominal);

  /// One LED's image, with the variance of each of its coordinates.
  struct Image {
    int led = 0;
    Vector2 uv = Vector2::Zero();
    double variance_px2 = 0;
  };

  /// A picture and its pose, nearly; kept when it shows a side that others do not, or
  /// shows it from nearer.
  /// @returns whether it is kept.
  bool offer(const Pose& X_NB, std::span<const Image> images);

  /// One Gauss-Newton step of all kept pictures.
  /// @returns false, and nothing changed, with less than two, or if LEDs would have to
  ///          stand where nobody mounts them: then the pictures are forgotten, for they
  ///          are not of these LEDs, or not of these correspondences.
  bool step();

  /// The LEDs stand again where they are written, and no picture is kept.
  void forget();

  /// As they were to begin with.
  const Constellation& written() const { return nominal_; }
  const Constellation& leds() const { return leds_; }
  const LedCovariance& cov() const { return cov_; }

 private:
  static constexpr std::size_t kMostPictures = 24;

  struct Picture {
    Pose X_NB = Pose::Identity();
    Vector3 side_B = Vector3::Zero();  ///< Towards the lens.
    double range_m = 0;
    FixedVector<Image, kMaxLeds> images;
    // Of the step: the pose's change is `change` less `by_leds` times that of the LEDs.
    Eigen::Matrix<double, 6, 1> change = Eigen::Matrix<double, 6, 1>::Zero();
    Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 3 * kMaxLeds> by_leds;
  };

  bool add_to_normal_equations(Picture& picture);
  void thin_out();

  LedLearnerConfig config_;
  Camera camera_;
  Constellation nominal_, leds_;
  LedCovariance cov_;
  FixedVector<Picture, kMostPictures> pictures_;
  double turn_;  // rad, by which pictures differ
  double led_sd_m_;
  LedCovariance S_;
  LedVector g_;
};

}  // namespace alight
