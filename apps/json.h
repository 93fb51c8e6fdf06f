#pragma once
#include <cmath>
#include <nlohmann/json.hpp>

#include "alight/geometry/pose.h"

using Json = nlohmann::ordered_json;

/// JSON knows no NaN.
inline Json number_or_null(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

inline Json as_json(const alight::Vector3& v) { return {v.x(), v.y(), v.z()}; }

inline Json as_json(const alight::Pose& X) {
  Eigen::Quaterniond q(X.linear());
  if (q.w() < 0) q.coeffs() *= -1;
  return {{"xyz_m", as_json(alight::Vector3(X.translation()))},
          {"quat_xyzw", {q.x(), q.y(), q.z(), q.w()}}};
}
