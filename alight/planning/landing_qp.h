#pragma once
#include <array>
#include <memory>
#include <vector>

#include "alight/planning/corridor.h"
#include "alight/planning/limits.h"
#include "alight/planning/reduction.h"

namespace alight {

enum class RowKind : std::uint8_t { position, speed, acceleration, force, body_rate };

/// Names one row of eqn:MP_OPT: a plane or face at a control point of a curve.
struct RowId {
  RowKind kind = RowKind::position;
  std::uint8_t segment = 0;
  std::uint8_t point = 0;
  std::uint8_t face = 0;  ///< Index into planes or the limit rows of that kind.

  bool operator==(const RowId&) const = default;
};

/// Gradient of a row by the variables: u if `basis` is Whitened::W, x if Reduction::M.
Matrix73 row_gradient(const RowId& row, const Corridor& corridor,
                      const DynamicLimitRows& limits, const SegmentFrames& frames,
                      const std::array<PointBasis, kSegments>& basis,
                      const std::array<Seconds, kSegments>& T);

/// Left side of a row minus its bound, for given control points: positive is violated.
double row_violation(const RowId& row, const Corridor& corridor,
                     const DynamicLimitRows& limits, const SegmentFrames& frames,
                     const std::array<ControlPoints, kSegments>& c,
                     const std::array<Seconds, kSegments>& T);

Constraint row_meaning(const RowId& row, const Corridor& corridor,
                       const DynamicLimitRows& limits);

struct QpOutcome {
  enum class Kind : std::uint8_t {
    solved,
    fixed_row,  ///< A boundary state is outside, whatever the rest.
    infeasible,
    no_convergence,
    yaw_rate,  ///< The heading cannot turn so fast (time allocation).
  };
  Kind kind = Kind::infeasible;
  RowId blame;  ///< The row that cannot be met, unless solved.
  Matrix73 u;   ///< Whitened solution.
  std::array<ControlPoints, kSegments> c;  ///< Its control points.
  double jerk_cost = 0;                    ///< m^2/s^5
  int rounds = 0;                          ///< Times that violated rows were added.
  int iterations = 0;                      ///< Of the active-set method.

  bool solved() const { return kind == Kind::solved; }
};

/// A row of the final working set and its multiplier, in the units of cost per row.
struct ActiveRow {
  RowId row;
  double multiplier = 0;
};

/// Solves eqn:MP_OPT for one pair of durations: least distance in whitened coordinates
/// by a dual active-set method (DAQP). Rows are priced by structure and handed over
/// only once violated; an optimum of the rows handed over that violates none of the
/// others is the optimum. Reuses its memory; no state passes from one solve to the
/// next.
class LandingQp {
 public:
  LandingQp();
  ~LandingQp();
  LandingQp(const LandingQp&) = delete;
  LandingQp& operator=(const LandingQp&) = delete;

  QpOutcome solve(const Reduction& reduction, const Corridor& corridor,
                  const DynamicLimitRows& limits);

  /// The rows with a multiplier of the last solve.
  const std::vector<ActiveRow>& active() const;

 private:
  struct Work;
  std::unique_ptr<Work> work_;
};

}  // namespace alight
