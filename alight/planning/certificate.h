#pragma once
#include "alight/planning/bernstein.h"
#include "alight/planning/corridor.h"

namespace alight {

/// What a trajectory is held against.
struct CertificateTask {
  PlannerConfig config;
  Rig rig;
  PlanRequest request;  ///< Start state and the platform's motion.
  FlatState end;
  /// The space it must stay in; null: that of a landing from the request's start.
  const Corridor* corridor = nullptr;
};

using Certificate = decltype(PlanResult::certificate);

/// Checks a trajectory without the solver and its matrices. Control points are not
/// trusted to bound it: over a steady platform every constraint is bounded along the
/// whole curve by subdivided Bernstein polynomials (to 1e-4 of its unit, on the safe
/// side), limits as norms of the motion in I (paper: boxes); over a forecast by samples
/// every 2 ms and what their second differences leave open. LEDs by projection and body
/// rates by differences of the flatness attitude every 5 ms.
Certificate certify(const CertificateTask& task, const Trajectory& trajectory);

/// The entry with the smallest margin; empty certificates have none.
const CertificateEntry* weakest(const Certificate& certificate);

/// Attitude of B in N by flatness: z along the specific force f_N = a_IB_N - g_N,
/// heading `yaw` of its x axis.
Matrix3 flat_attitude(const Vector3& f_N, double yaw);
Matrix3 flat_attitude(const PlatformState& platform, const FlatState& state);

}  // namespace alight
