#include "alight/calibration/light_tracks.h"

#include <gtest/gtest.h>

#include <map>

#include "alight/calibration/test/flight.h"

namespace alight {
namespace {

/// Lights of one picture: LEDs, those nearer than `merge_px` run together as one blob,
/// and strays that stand still. `led[k]`: which LED light k is, -1 for none or several.
struct Picture {
  std::vector<Blob> lights;
  std::vector<int> led;
  ObservedFrame drone;
};

Picture picture_of(const Rig& rig, const Pose& X_NB, std::span<const Vector2> strays,
                   double merge_px, double sd_px, Rng& rng) {
  Picture out;
  std::vector<bool> gone(static_cast<std::size_t>(rig.leds.size()), false);
  const auto image = [&](int i) {
    return *project_led(rig.camera, X_NB, rig.leds.p_BL(i));
  };
  const auto add = [&](const Vector2& uv, LedColor color, int led) {
    Blob blob;
    blob.uv = uv + Vector2(rng.normal(0, sd_px), rng.normal(0, sd_px));
    blob.color = color;
    out.lights.push_back(blob);
    out.led.push_back(led);
    if (led < 0) return;
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << led);
    o.uv = blob.uv;
    out.drone.seen.push_back(o);
  };
  for (int i = 0; i < rig.leds.size(); ++i) {
    if (gone[static_cast<std::size_t>(i)]) continue;
    Vector2 sum = image(i);
    int count = 1;
    for (int j = i + 1; j < rig.leds.size(); ++j) {
      if ((image(j) - image(i)).norm() > merge_px) continue;
      sum += image(j);
      ++count;
      gone[static_cast<std::size_t>(j)] = true;
    }
    add(sum / count, rig.leds.color(i), count == 1 ? i : -1);
  }
  for (const Vector2& uv : strays) add(uv, LedColor::white, -1);
  return out;
}

TEST(LightTracks, EachTrackIsOneLedAllAlong) {
  for (const double merge_px : {0.0, 5.0}) {
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      Rng rng(seed);
      const Rig rig = drawn_rig(0.006, rng);
      std::vector<Vector2> strays;
      for (int k = 0; k < 40; ++k) {
        strays.emplace_back(rng.uniform(0, 848), rng.uniform(0, 480));
      }
      LightTracks tracks(rig.leds);
      std::vector<Picture> pictures;
      int alone = 0;
      for (int f = 0; f < 400; ++f) {
        const double phase = static_cast<double>(seed);
        pictures.push_back(
            picture_of(rig, weaving(f / 60.0, phase), strays, merge_px, 0.1, rng));
        for (const int led : pictures.back().led) alone += led >= 0 ? 1 : 0;
        // Every third picture does not know the drone; its colours do.
        const Picture& p = pictures.back();
        tracks.add(p.lights, f % 3 == 0 ? nullptr : &p.drone);
      }
      int followed = 0, mixed = 0;
      for (const LightTrack& track : tracks.tracks()) {
        std::map<int, int> leds;
        for (int f = track.first; f <= track.last(); ++f) {
          const Picture& p = pictures[static_cast<std::size_t>(f)];
          for (std::size_t k = 0; k < p.lights.size(); ++k) {
            if (p.lights[k].uv == track.at(f).uv) ++leds[p.led[k]];
          }
        }
        leds.erase(-1);
        if (leds.empty()) continue;
        mixed += leds.size() > 1 ? 1 : 0;
        for (const auto& [led, count] : leds) followed += count;
      }
      EXPECT_EQ(mixed, 0) << "seed " << seed << ", merged below " << merge_px;
      EXPECT_GT(followed, 0.95 * alone) << "seed " << seed;
    }
  }
}

TEST(LightTracks, WithoutColourBeginsWhereTheDroneIs) {
  Rng rng(7);
  Rig rig = alan_rig();
  for (Led& led : rig.leds.leds) led.color = LedColor::none;
  const std::vector<Vector2> strays{{20, 20}, {800, 30}};
  LightTracks tracks(rig.leds);
  Picture p = picture_of(rig, weaving(0, 0), strays, 0, 0, rng);
  for (Blob& b : p.lights) b.color = LedColor::none;
  tracks.add(p.lights, nullptr);
  EXPECT_TRUE(tracks.tracks().empty());
  tracks.add(p.lights, &p.drone);
  EXPECT_EQ(tracks.tracks().size(), 6u);
  for (const LightTrack& t : tracks.tracks()) EXPECT_GE(t.seen.front().taken_for, 0);
  tracks.add({}, nullptr);
  tracks.add(p.lights, &p.drone);
  EXPECT_EQ(tracks.tracks().size(), 12u);  // none goes on over a picture without it
}

}  // namespace
}  // namespace alight
