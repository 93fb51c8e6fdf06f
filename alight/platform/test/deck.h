#pragma once
#include "alight/geometry/sensor_events.h"
#include "alight/geometry/so3.h"

namespace alight {

/// A deck at `t` that has rolled by `roll`, at its first and second derivative, about
/// an axis `lever` m below it.
inline PlatformState rolled(Time t, double roll, double rate, double acceleration,
                            double lever) {
  const Vector3 up(0, 0, lever);
  PlatformState x;
  x.t = t;
  x.X_IN.linear() = so3_exp(Vector3(roll, 0, 0));
  x.X_IN.translation() = x.X_IN.linear() * up;
  x.w_IN_N = Vector3(rate, 0, 0);
  x.alpha_IN_N = Vector3(acceleration, 0, 0);
  x.v_IN_N = x.w_IN_N.cross(up);
  x.a_IN_N = x.alpha_IN_N.cross(up) + x.w_IN_N.cross(x.v_IN_N);
  return x;
}

/// What sensors without errors read of it.
inline PlatformImu imu_of(const PlatformState& x) {
  PlatformImu imu;
  imu.captured = x.t;
  imu.w_IN_N = x.w_IN_N;
  imu.f_N = x.a_IN_N - gravity_N(x);
  return imu;
}

inline PlatformOdometry odometry_of(const PlatformState& x) {
  PlatformOdometry o;
  o.captured = x.t;
  o.X_IN = x.X_IN;
  o.v_IN_N = x.v_IN_N;
  o.w_IN_N = x.w_IN_N;
  return o;
}

}  // namespace alight
