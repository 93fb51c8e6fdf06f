#include "alight/mission/sight_watch.h"

#include <gtest/gtest.h>

#include <string>

namespace alight {
namespace {

constexpr Time kStep = 10'000'000;

/// Steps of 10 ms with a picture each, taken `lateness` before.
struct Camera {
  SightWatch watch{0.03};
  Time now = kStep;

  void run(int steps, Seconds lateness = 0.03, bool pictures = true) {
    for (int i = 0; i < steps; ++i) {
      now += kStep;
      watch.step(now);
      if (pictures) watch.picture(now - from_seconds(lateness), now);
    }
  }
};

TEST(SightWatch, PicturesInTimeLeaveOnlyTheLeds) {
  Camera c;
  EXPECT_EQ(c.watch.why(c.now), Blindness::pictures) << "there was none yet";
  c.run(100);
  EXPECT_EQ(c.watch.why(c.now), Blindness::leds);
  EXPECT_FALSE(c.watch.computer_was_late(c.now));
}

TEST(SightWatch, TellsMissingLateAndFrozenPicturesApart) {
  Camera c;
  c.run(100);
  c.run(19, 0, false);
  EXPECT_EQ(c.watch.why(c.now), Blindness::leds) << "a few pictures are no loss";
  c.run(5, 0, false);
  EXPECT_EQ(c.watch.why(c.now), Blindness::pictures);
  c.run(1, 0.17);
  EXPECT_EQ(c.watch.why(c.now), Blindness::leds);
  c.run(30, 0, false);
  c.run(1, 0.4);
  EXPECT_EQ(c.watch.why(c.now), Blindness::late);
  c.run(1);
  c.watch.frozen(true);
  EXPECT_EQ(c.watch.why(c.now), Blindness::frozen);
  c.watch.frozen(false);
  EXPECT_EQ(c.watch.why(c.now), Blindness::leds);
}

TEST(SightWatch, AStallIsBlamedOnTheComputerAndForgotten) {
  for (const int stalled : {10, 14, 16, 100}) {
    Camera c;
    c.run(100);
    c.now += (stalled - 1) * kStep;
    c.run(1);
    const Time again = c.now;
    const bool late = stalled > 15;
    EXPECT_EQ(c.watch.computer_was_late(c.now), late) << stalled;
    EXPECT_EQ(c.watch.why(c.now) == Blindness::computer, late) << stalled;
    c.run(140);
    EXPECT_EQ(c.watch.computer_was_late(c.now), late) << stalled;
    c.run(20);
    EXPECT_FALSE(c.watch.computer_was_late(c.now));
    EXPECT_EQ(c.watch.why(c.now), Blindness::leds);
    EXPECT_EQ(c.watch.woke(), late ? again : 0);
  }
}

TEST(SightWatch, EveryCauseHasWordsOfItsOwn) {
  const Blindness all[] = {Blindness::leds,   Blindness::pictures, Blindness::late,
                           Blindness::frozen, Blindness::computer, Blindness::odometry};
  for (const Blindness a : all) {
    EXPECT_NE(std::string(words_for(a).given_up).find("autopilot lands"),
              std::string::npos);
    for (const Blindness b : all) {
      EXPECT_EQ(std::string(words_for(a).lost) == words_for(b).lost, a == b);
      EXPECT_EQ(std::string(words_for(a).given_up) == words_for(b).given_up, a == b);
      EXPECT_EQ(std::string(to_string(a)) == to_string(b), a == b);
    }
  }
}

}  // namespace
}  // namespace alight
