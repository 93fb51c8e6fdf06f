#pragma once
#include <array>
#include <optional>
#include <span>

#include "alight/geometry/camera.h"
#include "alight/geometry/image.h"
#include "alight/vision/picture_noise.h"

namespace alight {

/// Finds out by what power of light a camera stores it (LinearPicture), from lights
/// that stand side by side: on a linear camera's picture they add up, on others they do
/// so by less, whatever a light looks like.
///
/// How one looks is found out with it, from the sides they turn to nobody: a sum of
/// Gaussians of fixed widths. Each look is a fit (Levenberg-Marquardt), of which `step`
/// makes one iteration, so that no picture takes long. No allocation.
class GammaLearner {
 public:
  static constexpr std::size_t kLightsMost = 3;
  /// Lights tell where the nearest two are so far apart, in sd of a light's width,
  static constexpr double kNearest = 1.8, kFarthest = 4.5;
  /// and nothing else shines within this of them.
  static constexpr double kAlone = 8;

  /// Takes the pixels around two or three lights of one colour, unless it is busy with
  /// earlier ones or knows enough. After a look that told nothing so many pictures are
  /// let pass, after the next twice as many. @param sd_px of a light's width in the
  /// picture as stored. @param noise of the same.
  void look(const ImageView& stored, std::span<const Vector2> lights, double sd_px,
            const PictureNoise& noise);

  bool busy() const { return iteration_ >= 0; }
  void step();

  /// What all looks so far say, 1 unless they exclude it; nothing until they say it
  /// well enough.
  std::optional<double> gamma() const;
  /// Further looks would hardly change it.
  bool settled() const;

 private:
  static constexpr int kWidths = 5;
  static constexpr int kPixelsMost = 256;
  static constexpr int kParametersMost =
      3 * static_cast<int>(kLightsMost) + kWidths + 2;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kParametersMost, 1>;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0,
                               kParametersMost, kParametersMost>;
  struct Equations {
    Matrix A;
    Vector g;
    double cost = 0, chi2 = 0;
  };
  /// In lanes (vision/lanes.h), the last one filled up with pixels that weigh nothing.
  struct Pixels {
    int count = 0, padded = 0;
    alignas(32) std::array<float, kPixelsMost> u, v, value, weight;
  };
  struct Model;
  int parameters() const { return 3 * lights_ + kWidths + 2; }
  void weigh(const PictureNoise& noise);
  /// Logarithm of what looks say, 0 where a camera that stores light itself is
  /// likelier.
  double exponent() const;
  Equations equations(const Vector& at) const;
  bool finish();  ///< @returns whether the look told something

  Pixels pixels_;
  int lights_ = 0;
  std::array<double, kWidths> variance_{};
  Vector start_, prior_, at_;
  Equations now_;
  double damping_ = 0;
  int iteration_ = -1;                // of the look it is busy with
  double information_ = 0, sum_ = 0;  // on the logarithm of gamma
  int looks_ = 0;
  int rest_ = 0, rests_ = 0;  // pictures to let pass, after the last vain look
};

}  // namespace alight
