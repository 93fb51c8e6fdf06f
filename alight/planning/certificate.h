#pragma once
#include <vector>

#include "alight/planning/planner.h"

namespace alight {

/// What a trajectory is held against.
struct CertificateTask {
  PlannerConfig config;
  Rig rig;
  PlanRequest request;  ///< Start state and the platform's motion.
  FlatState end;
};

using Certificate = FixedVector<CertificateEntry, 24>;

/// Checks a trajectory without the solver: control points are not trusted to bound it,
/// every constraint is bounded along the whole curve by subdivided Bernstein
/// polynomials (to 1e-4 of its unit, on the safe side), limits as norms of the motion
/// in I (paper: boxes), LEDs by projection at the flatness attitude every 5 ms.
Certificate certify(const CertificateTask& task, const Trajectory& trajectory);

/// The entry with the smallest margin; empty certificates have none.
const CertificateEntry* weakest(const Certificate& certificate);

/// Upper bound, at most `gap` above the maximum over [0, 1], of the polynomial with
/// these Bernstein coefficients (at most 15).
double bernstein_maximum(const double* coefficients, int count, double gap);

/// Attitude of B in N by flatness: z along a_IB_N - g_N, heading `yaw` of its x axis.
Matrix3 flat_attitude(const PlatformState& platform, const FlatState& state);

}  // namespace alight
