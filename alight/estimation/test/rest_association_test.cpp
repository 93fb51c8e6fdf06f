#include "alight/estimation/rest_association.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "alight/base/rng.h"

namespace alight {
namespace {

struct World {
  Rig rig = alan_rig();
  Rig truth = rig;
  Pose X_NB_rest, X_NB;
  RestCalibrationConfig config;
  std::vector<RestLight> lights;
  RestAssociation own;  // index of each LED's light

  explicit World(Rng& rng, double sds = 1) {
    X_NB_rest = make_pose(Matrix3::Identity(), Vector3(0, 0, rig.drone.gear_height_m));
    const auto n = [&](double sd) { return sds * rng.normal(0, sd); };
    const auto n3 = [&](double sd) { return Vector3(n(sd), n(sd), n(sd)); };
    X_NB = X_NB_rest;
    X_NB.translation() +=
        Vector3(n(config.place_sd_m), n(config.place_sd_m), n(config.height_sd_m));
    X_NB.linear() =
        X_NB.linear() * so3_exp(Vector3(n(config.tilt_sd_deg), n(config.tilt_sd_deg),
                                        n(config.heading_sd_deg)) *
                                kDegree);
    for (Led& led : truth.leds.leds) led.p_BL += n3(config.led_sd_m);
    truth.camera.X_NC.translation() += n3(config.mount_position_sd_m);
    truth.camera.X_NC.linear() = truth.camera.X_NC.linear() *
                                 so3_exp(n3(config.mount_rotation_sd_deg * kDegree));
    const double focal = 1 + n(config.focal_sd_share);
    truth.camera.intrinsics.fx *= focal;
    truth.camera.intrinsics.fy *= focal;
    own.fill(-1);
  }

  std::uint16_t colored(int led) const {
    std::uint16_t may_be = 0;
    for (int k = 0; k < rig.leds.size(); ++k) {
      if (rig.leds.color(k) == rig.leds.color(led)) {
        may_be = static_cast<std::uint16_t>(may_be | 1u << k);
      }
    }
    return may_be;
  }
  void show(Rng& rng, int led, bool any_color = false) {
    const auto uv = project_led(truth.camera, X_NB, truth.leds.p_BL(led));
    own[static_cast<std::size_t>(led)] = static_cast<int>(lights.size());
    lights.push_back({*uv + Vector2(rng.normal(0, 0.2), rng.normal(0, 0.2)),
                      any_color ? std::uint16_t{0x3f} : colored(led)});
  }
  Result<RestAssociation> associate(int least = 5) const {
    return associate_at_rest(config, rig.camera, rig.leds, lights, X_NB_rest, least);
  }
};

/// Shuffles the lights; `own` goes along.
void shuffle(World& w, Rng& rng) {
  for (std::size_t i = w.lights.size(); i-- > 1;) {
    const auto j = static_cast<std::size_t>(rng.uniform(0, 0.999) * double(i + 1));
    std::swap(w.lights[i], w.lights[j]);
    for (int& at : w.own) {
      if (at == static_cast<int>(i)) {
        at = static_cast<int>(j);
      } else if (at == static_cast<int>(j)) {
        at = static_cast<int>(i);
      }
    }
  }
}

/// Counts an answer, if there is one.
void tell(World& w, Rng& rng, int& right, int& wrong) {
  shuffle(w, rng);
  const auto found = w.associate();
  if (found) (*found == w.own ? right : wrong)++;
}

TEST(RestAssociation, TellsEveryLedByAllThatMayBeOff) {
  for (const bool any_color : {false, true}) {
    Rng rng(1);
    int right = 0, wrong = 0;
    constexpr int kRuns = 500;
    for (int run = 0; run < kRuns; ++run) {
      World w(rng);
      for (int i = 0; i < 6; ++i) w.show(rng, i, any_color);
      tell(w, rng, right, wrong);
    }
    EXPECT_GE(right, any_color ? 0.95 * kRuns : 0.99 * kRuns) << any_color;
    EXPECT_LE(wrong, 0.002 * kRuns) << any_color;
  }
}

// Lamps in their colours, and below each LED its twin in the pad, dimmer.
TEST(RestAssociation, AmongLampsAndTwinsToo) {
  Rng rng(2);
  int right = 0, wrong = 0;
  constexpr int kRuns = 500;
  for (int run = 0; run < kRuns; ++run) {
    World w(rng);
    for (int i = 0; i < 6; ++i) w.show(rng, i);
    for (int i = 0; i < 6; ++i) {
      Vector3 p_NL = w.X_NB * w.truth.leds.p_BL(i);
      p_NL.z() = -p_NL.z();
      const auto uv = w.truth.camera.intrinsics.project(
          Vector3(w.truth.camera.X_NC.inverse() * p_NL));
      if (rng.uniform(0, 1) < 0.5 && uv) w.lights.push_back({*uv, w.colored(i)});
    }
    for (int k = 0; k < 10; ++k) {
      w.lights.push_back(
          {Vector2(rng.uniform(0, 848), rng.uniform(0, 480)), w.colored(k % 6)});
    }
    tell(w, rng, right, wrong);
  }
  EXPECT_GE(right, 0.85 * kRuns);  // of the others two are about as likely
  EXPECT_LE(wrong, 0.01 * kRuns);
}

TEST(RestAssociation, AnLedThatIsDarkIsMissing) {
  Rng rng(3);
  int right = 0, wrong = 0;
  constexpr int kRuns = 300;
  for (int run = 0; run < kRuns; ++run) {
    World w(rng);
    for (int i = 0; i < 6; ++i) {
      if (i != run % 6) w.show(rng, i);
    }
    tell(w, rng, right, wrong);
  }
  EXPECT_GE(right, 0.9 * kRuns);
  EXPECT_LE(wrong, 0.01 * kRuns);
}

TEST(RestAssociation, WhatStandsElsewhereOrIsTooFewIsNone) {
  Rng rng(4);
  World few(rng);
  for (int i = 0; i < 4; ++i) few.show(rng, i);
  EXPECT_EQ(few.associate(5).error().fault, Fault::too_few_points);
  World none(rng);
  EXPECT_EQ(none.associate(4).error().fault, Fault::too_few_points);
  int found = 0;
  for (int run = 0; run < 100; ++run) {
    World w(rng);
    w.X_NB.translation() += Vector3(0.35, 0.3, 0.3);
    for (int i = 0; i < 6; ++i) w.show(rng, i);
    found += w.associate().has_value();
  }
  EXPECT_LE(found, 2);
}

TEST(RestAssociation, ManyLightsInAnyColourEndInAnAnswerOrInNone) {
  Rng rng(5);
  for (int run = 0; run < 20; ++run) {
    World w(rng);
    for (int i = 0; i < 6; ++i) w.show(rng, i, true);
    for (int k = 0; k < 200; ++k) {
      w.lights.push_back(
          {Vector2(rng.uniform(0, 848), rng.uniform(0, 480)), std::uint16_t{0x3f}});
    }
    const auto found = w.associate();
    if (!found) {
      EXPECT_TRUE(found.error().fault == Fault::ambiguous ||
                  found.error().fault == Fault::too_few_points);
    }
  }
}

}  // namespace
}  // namespace alight
