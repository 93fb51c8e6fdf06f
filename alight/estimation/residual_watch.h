#pragma once
#include <array>
#include <span>

#include "alight/geometry/rig.h"

namespace alight {

/// Learns from what a fitted pose leaves of LED images how exact rig and picture are:
/// what stays from picture to picture is an error of the LEDs' positions, what changes
/// is noise. No allocation.
class ResidualWatch {
 public:
  ResidualWatch() { mean_m_.fill(Vector2::Zero()); }

  /// One image of a single LED.
  struct Residual {
    int led = 0;
    Vector2 px = Vector2::Zero();
    Matrix26 H = Matrix26::Zero();  ///< Derivative of the image by the pose.
    double m_per_px = 0;            ///< At the LED: its depth over the focal length.
    double variance_px2 = 0;        ///< Of both coordinates together, as claimed.
    double left = 1;                ///< Share of it that the fit should leave.
  };

  /// The residuals of a picture at its fitted pose. Fewer than four LEDs say nothing.
  void add(std::span<const Residual> residuals);

  /// The LEDs' positions have been corrected: what stays is learnt anew.
  void begin_anew();

  /// Standard deviation of each coordinate of each LED's position, m: `supposed_m`
  /// until pictures tell otherwise.
  double led_sd_m(double supposed_m = 0) const;
  /// Factor on the claimed variances; at least `kLeast`.
  double noise() const { return noise_; }

  static constexpr double kLeast = 0.05, kMost = 100;

 private:
  void learn_noise(std::span<const Residual> residuals);
  void learn_leds(std::span<const Residual> residuals);

  std::array<Vector2, kMaxLeds> mean_m_;          // of each LED's residual,
  std::array<double, kMaxLeds> mean_noise_m2_{};  // and its variance; 0: not seen yet
  double noise_ = 1;
  double noise_told_ = 0;  // directions that told of it
  double constant_m2_ = 0;
  double hidden_m2_ = 0;  // what noise alone would leave of it
  double weight_ = 0;     // of both, m^-4
  double told_ = 0;       // directions in which pictures have told of LEDs
};

}  // namespace alight
