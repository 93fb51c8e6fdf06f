#pragma once
#include <Eigen/Core>
#include <array>
#include <optional>

#include "alight/base/result.h"
#include "alight/geometry/pose.h"

namespace alight {

using Matrix23 = Eigen::Matrix<double, 2, 3>;
using Matrix26 = Eigen::Matrix<double, 2, 6>;

/// Pinhole camera with Brown's radial-tangential distortion (Brown 1971, the order of
/// OpenCV). Pixel centres lie at whole numbers; (0, 0) is the centre of the first
/// pixel.
struct Intrinsics {
  int width = 848;
  int height = 480;
  double fx = 415.872;                 ///< px
  double fy = 415.571;                 ///< px
  double cx = 423.296;                 ///< px
  double cy = 248.135;                 ///< px
  std::array<double, 5> distortion{};  ///< k1 k2 p1 p2 k3

  bool has_distortion() const;

  /// Image of a point in C (optical axes); empty for points not in front of the lens
  /// (z below 1 cm). May lie outside the picture.
  std::optional<Vector2> project(const Vector3& p_CL) const;

  /// As `project`, with the derivative of the image by p_CL.
  std::optional<Vector2> project(const Vector3& p_CL, Matrix23& duv_dp) const;

  /// Direction through a pixel, z = 1, with distortion removed (fixed-point iteration,
  /// 1e-10 px for lenses that are invertible in the picture).
  Vector3 unproject(const Vector2& uv) const;

  /// Whether a direction belongs to a pixel that `unproject` finds: the polynomial of a
  /// strong distortion may turn back before the picture's corners.
  bool sees(const Vector2& uv) const;

  /// Whether a pixel lies in the picture, at least `border` px from its edge.
  bool contains(const Vector2& uv, double border = 0) const;
};

/// The platform camera: lens and place. X_NC has optical axes: x right, y down, z out.
struct Camera {
  Intrinsics intrinsics;
  Pose X_NC = Pose::Identity();
};

/// Image of LED `p_BL` for the body pose X_NB, with the derivative by the tangent
/// (dp_NB in N, dR in B) of X_NB when `J` is given (paper, eqn:RSE_Rreproj).
std::optional<Vector2> project_led(const Camera& camera, const Pose& X_NB,
                                   const Vector3& p_BL, Matrix26* J = nullptr);

}  // namespace alight
