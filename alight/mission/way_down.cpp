#include "alight/mission/way_down.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alight/mission/into_view.h"

namespace alight {
namespace {

constexpr Seconds kOnFloor = 2;      // the platform is looked at for so long after it
constexpr Seconds kSlides = 0.6;     // light on its feet, until its motors stop
constexpr double kRoomBeside = 0.1;  // m, from the pad's corner to a rotor
constexpr double kHardestStop = 3;   // m/s^2, of a platform
constexpr int kInstants = 8;
// What a wind may be instead of the one that is believed: a share of it, turned, deg.
struct Wind {
  double share, turned_deg;
};
constexpr Wind kWinds[] = {{0, 0}, {0.7, 0}, {1.3, 0}, {1.3, 15}, {1.3, -15}};
// Of places to leave it at: to the side, and farther back, m.
constexpr double kAside[] = {0, 0.8, -0.8, 1.3, -1.3};
constexpr double kBack[] = {0, 0.8};

/// Chord of an arc, turned by half its angle, as a share of the arc.
double chord(double angle) {
  const double half = 0.5 * angle;
  return std::abs(half) < 1e-6 ? 1 : std::sin(half) / half;
}

}  // namespace

double braking(Seconds tau, Seconds t) {
  return std::isinf(tau) ? t : tau * (1 - std::exp(-t / tau));
}

WayDown::WayDown(const Rig& rig)
    : camera_(rig.camera),
      leds_(rig.leds),
      outline_(rig),
      gear_height_(rig.drone.gear_height_m),
      above_floor_(rig.pad.above_floor_m),
      reach_(std::sqrt(0.5) * rig.pad.size_m + rig.drone.arm_m +
             rig.drone.propeller_radius_m) {}

double WayDown::nearest(const LeftDrone& drone, const PlatformState& platform,
                        Seconds brakes_in) const {
  const double height = std::max(0.0, drone.p_NB.z() + above_floor_ - gear_height_);
  const Seconds down = kSinksAfter + height / kSinksLeast;
  double nearest = outline_.off(drone.p_NB);
  for (int k = 1; k <= kInstants; ++k) {
    const Seconds t = k * (down + kOnFloor) / kInstants;
    const Seconds flown = std::min(t, down + kSlides);
    const Seconds flies = braking(kBrakes, flown);
    const Vector3 moved =
        flies * drone.v_IB_N + kBrakes * (flown - flies) * drone.push_N;
    const Seconds driven = braking(brakes_in, t);
    const double turned = driven * platform.w_IN_N.z();
    const Vector3 way =
        from_rpy(0, 0, 0.5 * turned) * (chord(turned) * driven * platform.v_IN_N);
    nearest = std::min(
        nearest, outline_.off(from_rpy(0, 0, -turned) * (drone.p_NB + moved - way)));
  }
  return nearest;
}

bool WayDown::comes_near(const LeftDrone& drone, const PlatformState& platform,
                         Seconds brakes_in) const {
  return nearest(drone, platform, brakes_in) <= reach_ + kRoomBeside;
}

bool WayDown::clear(const LeftDrone& drone, const PlatformState& platform) const {
  return std::none_of(std::begin(kWinds), std::end(kWinds), [&](const Wind& wind) {
    LeftDrone in_wind = drone;
    in_wind.push_N =
        wind.share * (from_rpy(0, 0, wind.turned_deg * kDegree) * drone.push_N);
    return comes_near(in_wind, platform, std::numeric_limits<double>::infinity());
  });
}

bool WayDown::clear_of_stop(const LeftDrone& drone,
                            const PlatformState& platform) const {
  // Until its autopilot acts it flies on.
  LeftDrone late = drone;
  late.p_NB += kSinksAfter * drone.v_IB_N;
  // As long a way as evenly braked.
  const Seconds stop = platform.v_IN_N.head<2>().norm() / (2 * kHardestStop);
  return nearest(late, platform, stop) > reach_;
}

WayDown::Places WayDown::places(const Vector3& first) const {
  Places out;
  out.push_back(first);
  Vector3 back = first - camera_.X_NC.translation();
  back.z() = 0;
  if (back.norm() < 1e-3) return out;
  back.normalize();
  const Vector3 aside = Vector3::UnitZ().cross(back);
  for (const double b : kBack) {
    for (const double a : kAside) {
      const Vector3 place = first + b * back + a * aside;
      const bool another = a != 0 || b != 0;
      if (another && outline_.clear(place) && in_view(camera_, leds_, place)) {
        out.push_back(place);
      }
    }
  }
  return out;
}

}  // namespace alight
