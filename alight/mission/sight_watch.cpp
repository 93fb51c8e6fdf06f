#include "alight/mission/sight_watch.h"

namespace alight {
namespace {

// A gap between two steps that the autopilot all but takes for a lost link
// (COM_OF_LOSS_T, 0.3 s or less), and how long what follows is blamed on it: finding
// the drone again takes that long.
constexpr Seconds kStall = 0.15;
constexpr Seconds kStallBlamed = 1.5;
// Longer than any gap or lateness that a healthy camera leaves.
constexpr Seconds kNoPicture = 0.2;
constexpr Seconds kLate = 0.15;

}  // namespace

const char* to_string(Blindness why) {
  switch (why) {
    case Blindness::leds:
      return "leds";
    case Blindness::pictures:
      return "pictures";
    case Blindness::late:
      return "late";
    case Blindness::frozen:
      return "frozen";
    case Blindness::computer:
      return "computer";
    case Blindness::odometry:
      return "odometry";
  }
  return "leds";
}

bool dark(Blindness why) {
  return why == Blindness::pictures || why == Blindness::frozen;
}

BlindnessWords words_for(Blindness why) {
  switch (why) {
    case Blindness::pictures:
      return {"no pictures come from the camera",
              "no pictures come from the camera: the autopilot lands"};
    case Blindness::late:
      return {"the pictures come too late",
              "the pictures come too late: the autopilot lands"};
    case Blindness::frozen:
      return {"the camera repeats its picture",
              "the camera repeats its picture: the autopilot lands"};
    case Blindness::computer:
      return {"the computer stood still",
              "the computer stood still, the LEDs are lost: the autopilot lands"};
    case Blindness::odometry:
      return {"no platform odometry comes, and the LEDs are out of sight",
              "without platform odometry the LEDs are lost: the autopilot lands"};
    case Blindness::leds:
      break;
  }
  return {"the LEDs are out of sight",
          "the LEDs stay out of sight: the autopilot lands"};
}

void SightWatch::picture(Time captured, Time received) {
  if (any_ && captured <= captured_) return;
  any_ = true;
  captured_ = captured;
  received_ = received;
}

void SightWatch::step(Time now) {
  if (stepped_ && to_seconds(now - last_step_) > kStall) {
    stalled_ = true;
    stalled_until_ = now;
  }
  stepped_ = true;
  last_step_ = now;
}

bool SightWatch::computer_was_late(Time now) const {
  return stalled_ && to_seconds(now - stalled_until_) < kStallBlamed;
}

Blindness SightWatch::why(Time now) const {
  if (computer_was_late(now)) return Blindness::computer;
  if (!any_ || to_seconds(now - received_) > kNoPicture) return Blindness::pictures;
  if (to_seconds(received_ - captured_) > lateness_ + kLate) return Blindness::late;
  return frozen_ ? Blindness::frozen : Blindness::leds;
}

}  // namespace alight
