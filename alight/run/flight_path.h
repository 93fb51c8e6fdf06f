#pragma once
#include <array>

#include "alight/base/result.h"
#include "alight/base/rng.h"
#include "alight/base/time.h"
#include "alight/geometry/relative_state.h"
#include "alight/geometry/rig.h"

namespace alight {

/// Where a drone may fly that shows its LEDs to the platform's camera.
struct FlightPathConfig {
  static constexpr double kRoom_m = 0.01, kRangeMost_m = 100;
  static constexpr double kSpeedLeast_m_s = 0.05, kSpeedMost_m_s = 10;

  double range_min_m = 0.5;  ///< From the lens.
  double range_max_m = 3;
  double speed_m_s = 1.8;  ///< The fastest moment is at 85 % of it or more.
  double heading_off_min_deg =
      30;  ///< The side that LEDs face sways about the lens by an
  double heading_off_max_deg = 40;  ///< amplitude drawn from here.
  double turn_rate_rad_s = 4;
  double tilt_max_deg = 30;
  double border_px = 8;          ///< All LEDs stay so far inside the picture.
  double close_px = 4;           ///< Two LEDs less than this apart look like one,
  double close_share = 1.0 / 3;  ///< in at least that share of the flight, if the rig
                                 ///< lets it.
  Result<void> validate() const;
};

/// A smooth random flight before the camera of a platform that neither turns nor
/// accelerates: sums of sines, the tilt that the acceleration asks for, no wind.
class FlightPath {
 public:
  /// @returns infeasible when the rig's camera leaves no room for such a flight.
  static Result<FlightPath> draw(const FlightPathConfig& config, const Rig& rig,
                                 Seconds duration, Rng rng);

  RelativeState at(Seconds t) const;

  /// Share of the flight in which the closest two images of LEDs are less than
  /// `close_px` apart.
  double close_share() const { return close_share_; }

 private:
  /// A sum of sines, brought to [-1, 1] over the flight.
  class Wave {
   public:
    Wave(Rng rng, double pace, Seconds duration);
    double operator()(Seconds t) const { return scale_ * (sum(t) - middle_); }

   private:
    double sum(Seconds t) const;
    std::array<double, 3> amplitude_{}, rate_{}, phase_{};
    double middle_ = 0;
    double scale_ = 1;
  };

  FlightPath(const FlightPathConfig& config, const Rig& rig, Seconds duration,
             double pace, const Rng& rng);
  Vector3 position(Seconds t) const;
  Vector3 velocity(Seconds t) const;
  Matrix3 attitude(Seconds t) const;
  double top_speed() const;
  bool holds(const FlightPathConfig& config, const Rig& rig);

  Seconds duration_;
  Pose X_NC_;
  double range_min_, range_max_;
  double edge_[4];  ///< Tangents of the view at its left, right, top, bottom.
  double size_;
  double height_;           ///< In N, that B stays above, m.
  double front_ = 0;        ///< Where LEDs face, heading in B, rad
  double heading_off_ = 0;  ///< rad
  Wave range_, across_, down_, heading_;
  double close_share_ = 0;
};

}  // namespace alight
