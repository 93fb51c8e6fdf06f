#include "alight/mission/mission_config.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "alight/base/bounds.h"
#include "alight/mission/into_view.h"
#include "alight/mission/mission_input.h"
#include "alight/planning/rig_fit.h"

namespace alight {
namespace {

// Of rigs drawn at random with higher pads one in six crashed that started behind them.
constexpr double kHighestFromFloor = 0.6;  // m

// A drone may come down so far off, as a share of what its feet have to the pad's edge.
constexpr double kRoomShare = 0.8;
constexpr double kLeastRoom = 0.04;  // m; more exactly nothing lands in wind
constexpr double kMostRoom = 0.2;    // m; beyond, something is wrong
constexpr double kThrownUp = 0.15;  // m; what thrust grew to as it lifted carries it on
constexpr double kFarther = 1.8;    // times, to have that room
constexpr double kPlaceRoom = 0.05;  // m; a landing begins where the drone is by then
constexpr double kBeyondLeast = 0.545;  // m; time to settle, whatever its size

/// So far from the lens along its optical axis; where no landing begins so low, as
/// little above the axis as it takes to be higher and still in view, or farther off.
Vector3 place_in_view(const Rig& rig, const PlannerConfig& plans, double distance) {
  const Vector3 on_axis = above_axis(rig.camera, distance, 0);
  if (on_axis.z() >= lowest_start_m(plans)) return on_axis;
  const LandingView view(plans, rig);
  Vector3 best = on_axis;
  for (double farther = 1; farther <= kFarther; farther += 0.1) {
    for (double up = 0; up < kPi / 2; up += kUpStep) {
      const Vector3 place = above_axis(rig.camera, farther * distance, up);
      if (place.z() < lowest_start_m(plans)) continue;
      if (!in_view(rig.camera, rig.leds, place)) break;
      if (view.room(place, plans.tilt_max_deg).m >= kPlaceRoom) return place;
      if (best == on_axis) best = place;
    }
  }
  return best;
}

}  // namespace

Result<void> MissionConfig::validate() const {
  if (auto good = check_bounds({
          {"mission.follow_distance", follow_distance, 1.2, 10},
          {"mission.rendezvous_distance", rendezvous_distance, 1.2, 10},
          {"mission.take_off_height_m", take_off_height_m, 0, 20},
          {"mission.climb_speed_m_s", climb_speed_m_s, 0.05, 5},
          {"mission.move_speed_m_s", move_speed_m_s, 0.05, 10},
          {"mission.search_speed_m_s", search_speed_m_s, 0.05, 10},
          {"mission.move_acceleration_m_s2", move_acceleration_m_s2, 0.1, 10},
          {"mission.plan_ahead_s", plan_ahead_s, 0.01, 1},
          {"mission.commit_height_m", commit_height_m, 0, 5},
          {"mission.commit_error_m", commit_error_m, 0, 1},
          {"mission.wait_error_m", wait_error_m, 0, 1},
          {"mission.wait_least_m", wait_least_m, 0.001, 1},
          {"mission.wait_share", wait_share, 0, 10},
          {"mission.wait_room_m", wait_room_m, 0, 5},
          {"mission.wait_more_s", wait_more_s, 0.1, 600},
          {"mission.take_off_back_m", take_off_back_m, 0, 1},
          {"mission.lift_m", lift_m, 0.001, 0.2},
          {"mission.slip_m", slip_m, 0.005, 1},
          {"mission.slip_m_s", slip_m_s, 0.005, 10},
          {"mission.slip_tilt_deg", slip_tilt_deg, 1, 60},
          {"mission.sink_m", sink_m, 0, 0.5},
          {"mission.replan_every_s", replan_every_s, 0, 60},
          {"mission.settle_share", settle_share, 0, 1},
          {"mission.settle_down_s", settle_down_s, 0.02, 2},
          {"mission.flare_s", flare_s, 0, 2},
          {"mission.flare_share", flare_share, 0, 1},
          {"mission.flare_max_m_s2", flare_max_m_s2, 0, 10},
          {"mission.square_up_s", square_up_s, 0, kTouchAhead},
          {"mission.quiet_deg", quiet_deg, 0, 30},
          {"mission.quiet_more_s", quiet_more_s, 0.1, 100},
          {"mission.upright_deg", upright_deg, 1, 90},
          {"mission.ramp_from", ramp_from, 0, 1},
          {"mission.ramp_rate", ramp_rate, 0.05, 5},
          {"mission.ramp_to", ramp_to, 1, 2.5},
          {"mission.search_climb_m", search_climb_m, 0, 10},
          {"mission.give_up_s", give_up_s, 0.1, 30},
          {"mission.give_up_dark_s", give_up_dark_s, 0.1, 30},
          {"mission.give_up_late_s", give_up_late_s, 0.1, 60},
          {"mission.stop_acceleration_m_s2", stop_acceleration_m_s2, 0.1, 10},
          {"mission.leave_max_s", leave_max_s, 0, 60},
          {"mission.unsettled_max_s", unsettled_max_s, 1, 3600},
          {"mission.battery_sure_s", battery_sure_s, 0, 10},
      });
      !good) {
    return good;
  }
  if (!follow_point.allFinite() || !rendezvous_point.allFinite()) {
    return fail(Fault::invalid_config, "mission: a point is not finite");
  }
  return {};
}

MissionConfig places_for(MissionConfig config, const Rig& rig) {
  const double unit = view_unit_m(rig);
  const double beyond =
      std::min(unit, std::max(kSizesAway * rig.drone.size_m, kBeyondLeast));
  const PlannerConfig plans = fitted_to({}, rig);
  const auto place = [&](double multiple) {
    return place_in_view(rig, plans, unit + (multiple - 1) * beyond);
  };
  if (config.rendezvous_point.isZero()) {
    config.rendezvous_point = place(config.rendezvous_distance);
  }
  if (config.follow_point.isZero()) config.follow_point = place(config.follow_distance);
  if (config.search_point.isZero()) {
    config.search_point = config.follow_point;
    for (double up = 0.05; up <= config.search_climb_m; up += 0.05) {
      const Vector3 higher = config.follow_point + Vector3(0, 0, up);
      if (!in_view(rig.camera, rig.leds, higher)) break;
      config.search_point = higher;
    }
  }
  if (config.commit_error_m <= 0) {
    const double room = (rig.pad.size_m - rig.drone.size_m) / 2;
    config.commit_error_m = std::clamp(kRoomShare * room, kLeastRoom, kMostRoom);
  }
  if (config.safety.leave_at_m.isZero()) config.safety.leave_at_m = config.follow_point;
  if (config.take_off_height_m <= 0) {
    const double gear = rig.drone.gear_height_m;
    double height = gear;
    while (height < gear + 0.3 &&
           in_view(rig.camera, rig.leds, Vector3(0, 0, height + 0.01 + kThrownUp))) {
      height += 0.01;
    }
    config.take_off_height_m = std::max(gear + 0.08, height);
  }
  return config;
}

Result<void> check_places(const MissionConfig& config, const Rig& rig) {
  const MissionConfig placed = places_for(config, rig);
  const PlannerConfig plans = fitted_to({}, rig);
  const LandingView view(plans, rig);
  const double lowest = lowest_start_m(plans);
  if (config.start_on_floor && rig.pad.above_floor_m > kHighestFromFloor) {
    std::ostringstream text;
    text << "pad.above_floor_m is " << rig.pad.above_floor_m
         << ": a drone that starts from the floor climbs unseen, and the wind may have "
            "it in the platform before it is above the pad (more than "
         << kHighestFromFloor << " m is not flown): start it from the pad";
    return fail(Fault::invalid_config, text.str());
  }
  for (const Vector3& place : {placed.follow_point, placed.rendezvous_point}) {
    if (place.z() >= lowest && in_view(rig.camera, rig.leds, place) &&
        view.room(place, plans.tilt_max_deg).m >= 0) {
      continue;
    }
    std::ostringstream text;
    text << std::fixed << std::setprecision(2) << "camera: it sees no place "
         << place.head<2>().norm() << " m beyond the pad and " << lowest
         << " m above it, where a landing begins: turn the camera up "
         << "(mount.rpy_deg), or take a wider lens";
    return fail(Fault::invalid_config, text.str());
  }
  return {};
}

Result<void> check_pictures(const CameraTiming& timing) {
  const double oldest_ms = timing.frame_to_use_ms + 1000 / timing.rate_hz;
  if (oldest_ms < 1000 * kFreshSight) return {};
  std::ostringstream text;
  text << "camera: the newest picture is up to " << std::lround(oldest_ms)
       << " ms old (frame_to_use_ms, and the time until the next one by rate_hz); a "
          "landing needs one of the last "
       << std::lround(1000 * kFreshSight) << " ms";
  return fail(Fault::invalid_config, text.str());
}

}  // namespace alight
