#include "alight/mission/landing_io.h"

namespace alight {

const char* to_string(MissionState state) {
  switch (state) {
    case MissionState::idle:
      return "idle";
    case MissionState::armed:
      return "armed";
    case MissionState::taken_off:
      return "taken_off";
    case MissionState::follow:
      return "follow";
    case MissionState::rendezvous:
      return "rendezvous";
    case MissionState::land:
      return "land";
    case MissionState::shut_down:
      return "shut_down";
    case MissionState::complete:
      return "complete";
    case MissionState::hold:
      return "hold";
    case MissionState::go_around:
      return "go_around";
    case MissionState::lost_target:
      return "lost_target";
    case MissionState::lost_link:
      return "lost_link";
    case MissionState::aborted:
      return "aborted";
    case MissionState::refused:
      return "refused";
    case MissionState::pilot:
      return "pilot";
  }
  return "idle";
}

const char* to_string(Stage stage) {
  switch (stage) {
    case Stage::step:
      return "step";
    case Stage::detect:
      return "detect";
    case Stage::associate:
      return "associate";
    case Stage::filter:
      return "filter";
    case Stage::mission:
      return "mission";
    case Stage::control:
      return "control";
  }
  return "step";
}

}  // namespace alight
