/// The finder on thousands of scenes: right, no answer or wrong, and what a picture
/// costs, for each kind of scene. Not a benchmark of the usual kind: run it by hand,
///   finder_matrix [SEEDS [FIRST_SEED [CELL]]]
/// where CELL is part of a cell's name. A wrong answer is printed with its seed.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include "alight/base/rng.h"
#include "alight/run/cpu_time.h"
#include "alight/sim/camera_renderer.h"
#include "alight/vision/blob_detector.h"
#include "alight/vision/led_finder.h"

namespace alight {
namespace {

enum class Body { alan, infrared, four, ring, random };

struct Cell {
  const char* name;
  Body body = Body::alan;
  bool rendered = true;  ///< By the simulated camera, else by projection and merging.
  int strays = 0;
  bool clustered = false;
  int hidden = 0;
  double led_mm = 0;
  double range_min = 0.4, range_max = 3.2;
  double tilt_max = 35;
  double speed = 0;     ///< m/s, blurs at 2 ms.
  double lying = 0;     ///< Share of LEDs whose colour reads white or another's.
  int room_lights = 0;  ///< Rendered ones.
  int leds = 6;         ///< Of a random or ring body.
};

const Cell kCells[] = {
    {.name = "render"},
    {.name = "render near", .range_max = 1.5},
    {.name = "render 40", .strays = 40},
    {.name = "render 100", .strays = 100},
    {.name = "render 100 clustered", .strays = 100, .clustered = true},
    {.name = "render room 40", .room_lights = 40},
    {.name = "render blur", .speed = 1.8},
    {.name = "render 2mm", .led_mm = 2},
    {.name = "render 2mm 40", .strays = 40, .led_mm = 2},
    {.name = "render 2mm 100", .strays = 100, .led_mm = 2},
    {.name = "render hidden 1", .hidden = 1},
    {.name = "render hidden 1 2mm 40", .strays = 40, .hidden = 1, .led_mm = 2},
    {.name = "render hidden 2", .hidden = 2},
    {.name = "render hidden 2 40", .strays = 40, .hidden = 2},
    {.name = "render lying", .lying = 0.2},
    {.name = "render lying 40", .strays = 40, .lying = 0.2},
    {.name = "ir", .body = Body::infrared},
    {.name = "ir 40", .body = Body::infrared, .strays = 40},
    {.name = "ir 100", .body = Body::infrared, .strays = 100},
    {.name = "ir 100 clustered",
     .body = Body::infrared,
     .strays = 100,
     .clustered = true},
    {.name = "ir 2mm", .body = Body::infrared, .led_mm = 2},
    {.name = "ir 2mm 100", .body = Body::infrared, .strays = 100, .led_mm = 2},
    {.name = "ir hidden 1", .body = Body::infrared, .hidden = 1},
    {.name = "ir hidden 2", .body = Body::infrared, .hidden = 2},
    {.name = "ir hidden 2 100", .body = Body::infrared, .strays = 100, .hidden = 2},
    {.name = "ideal", .rendered = false},
    {.name = "ideal 2mm", .rendered = false, .led_mm = 2},
    {.name = "four 0", .body = Body::four, .rendered = false},
    {.name = "four 40", .body = Body::four, .rendered = false, .strays = 40},
    {.name = "ring8 0", .body = Body::ring, .rendered = false, .leds = 8},
    {.name = "ring8 40",
     .body = Body::ring,
     .rendered = false,
     .strays = 40,
     .leds = 8},
    {.name = "ring8 hidden 3",
     .body = Body::ring,
     .rendered = false,
     .hidden = 3,
     .leds = 8},
    {.name = "random4", .body = Body::random, .rendered = false, .leds = 4},
    {.name = "random5 40",
     .body = Body::random,
     .rendered = false,
     .strays = 40,
     .leds = 5},
    {.name = "random8 40",
     .body = Body::random,
     .rendered = false,
     .strays = 40,
     .leds = 8},
    {.name = "random12 100",
     .body = Body::random,
     .rendered = false,
     .strays = 100,
     .leds = 12},
    {.name = "random16 100",
     .body = Body::random,
     .rendered = false,
     .strays = 100,
     .leds = 16},
};

Rig rig_of(const Cell& cell, std::uint64_t seed) {
  Rig rig = alan_rig();
  Rng rng = Rng(seed).fork("rig");
  switch (cell.body) {
    case Body::alan:
      break;
    case Body::infrared:
      for (Led& led : rig.leds.leds) led.color = LedColor::none;
      break;
    case Body::four:
      rig.leds.leds = {{{0.08, -0.07, -0.04}, LedColor::green},
                       {{0.06, -0.02, 0.01}, LedColor::red},
                       {{0.09, 0.03, -0.05}, LedColor::green},
                       {{0.06, 0.08, -0.01}, LedColor::red}};
      break;
    case Body::ring:
      // Uneven on purpose: an even ring looks alike from every side.
      rig.leds.leds.clear();
      for (int i = 0; i < cell.leds; ++i) {
        const double way = 2 * kPi * (i + 0.35 * std::sin(2.0 * i)) / cell.leds;
        rig.leds.leds.push_back({{0.09 * std::cos(way), 0.09 * std::sin(way),
                                  i % 3 == 0 ? -0.04 : 0.02 * (i % 2)},
                                 i % 2 == 0 ? LedColor::green : LedColor::red});
      }
      break;
    case Body::random:
      rig.leds.leds.clear();
      while (rig.leds.size() < cell.leds) {
        const Vector3 p(rng.uniform(0.02, 0.1), rng.uniform(-0.1, 0.1),
                        rng.uniform(-0.06, 0.02));
        bool apart = true;
        for (const Led& led : rig.leds.leds)
          apart = apart && (led.p_BL - p).norm() > 0.02;
        if (!apart) continue;
        rig.leds.leds.push_back({p, rng.chance(0.5) ? LedColor::green : LedColor::red});
      }
      break;
  }
  return rig;
}

struct Drawn {
  Pose X_NB = Pose::Identity();
  std::vector<Blob> blobs;
};

/// A pose with all LEDs in the picture and at least four of them lit towards the lens.
Pose draw_pose(const Cell& cell, const Rig& rig, Rng& rng) {
  const Intrinsics& lens = rig.camera.intrinsics;
  for (;;) {
    const double range = rng.uniform(cell.range_min, cell.range_max);
    const Vector2 uv(rng.uniform(20, lens.width - 20),
                     rng.uniform(20, lens.height - 20));
    const Vector3 p_NB =
        rig.camera.X_NC * Vector3(range * lens.unproject(uv).normalized());
    const double tilt = rng.uniform(0, cell.tilt_max * kDegree);
    const double way = rng.uniform(0, 2 * kPi), yaw = rng.uniform(-kPi, kPi);
    const Pose X_NB = make_pose(
        so3_exp(tilt * Vector3(std::cos(way), std::sin(way), 0)) * from_rpy(0, 0, yaw),
        p_NB);
    if (p_NB.z() < 0.1) continue;
    int lit = 0;
    bool inside = true;
    for (const Led& led : rig.leds.leds) {
      const auto image = project_led(rig.camera, X_NB, led.p_BL);
      inside = inside && image && lens.contains(*image, 8);
      const Vector3 way_B = X_NB.inverse() * rig.camera.X_NC.translation() - led.p_BL;
      lit += way_B.normalized().x() > 0.25;
    }
    if (!inside) continue;
    if (cell.body == Body::ring || lit >= 4) return X_NB;
  }
}

LedColor lamp(Rng& rng) {
  const double draw = rng.uniform();
  return draw < 0.1 ? LedColor::red : draw < 0.2 ? LedColor::green : LedColor::white;
}

Blob light(const Vector2& uv, LedColor color, double brightness, Rng& rng) {
  Blob blob;
  blob.uv = uv + 0.1 * Vector2(rng.normal(), rng.normal());
  blob.cov = 0.01 * Matrix2::Identity();
  blob.spread = 1.2 * Matrix2::Identity();
  blob.area_px = 12;
  blob.brightness = brightness;
  blob.peak = 255;
  blob.color = color;
  return blob;
}

/// Images by projection; lights closer than 3.5 px make one patch.
std::vector<Blob> projected(const Cell& cell, const Rig& truth, const Pose& X_NB,
                            const std::vector<bool>& off, Rng& rng) {
  std::vector<Blob> blobs;
  for (int i = 0; i < truth.leds.size(); ++i) {
    if (off[static_cast<std::size_t>(i)]) continue;
    const Vector3 way_B =
        X_NB.inverse() * truth.camera.X_NC.translation() - truth.leds.p_BL(i);
    const bool all_round = cell.body == Body::ring;
    if (!all_round && way_B.x() <= 0) continue;
    const auto uv = project_led(truth.camera, X_NB, truth.leds.p_BL(i));
    if (!uv) continue;
    Blob blob =
        light(*uv, truth.leds.color(i), 1500 * std::exp(0.2 * rng.normal()), rng);
    const auto touching = std::find_if(blobs.begin(), blobs.end(), [&](const Blob& b) {
      return (b.uv - blob.uv).norm() < 3.5;
    });
    if (touching == blobs.end()) {
      blobs.push_back(blob);
      continue;
    }
    const double w = blob.brightness / (blob.brightness + touching->brightness);
    const Vector2 d = blob.uv - touching->uv;
    touching->spread += w * (1 - w) * d * d.transpose();
    touching->uv += w * d;
    if (w > 0.5) touching->color = blob.color;
    touching->brightness += blob.brightness;
    touching->area_px += 5;
  }
  return blobs;
}

class Stage {
 public:
  explicit Stage(const Cell& cell)
      : cell_(cell), detector_(std::move(*BlobDetector::create({}, 848, 480))) {}

  Drawn draw(const Rig& rig, std::uint64_t seed) {
    Rng rng(seed);
    Drawn scene;
    Rig truth = rig;
    for (Led& led : truth.leds.leds) {
      led.p_BL +=
          cell_.led_mm * 1e-3 * Vector3(rng.normal(), rng.normal(), rng.normal());
    }
    scene.X_NB = draw_pose(cell_, rig, rng);
    std::vector<bool> off(static_cast<std::size_t>(rig.leds.size()), false);
    for (int n = 0; n < cell_.hidden;) {
      const auto i = static_cast<std::size_t>(rng.uniform(0, rig.leds.size()));
      n += !off[i];
      off[i] = true;
    }
    scene.blobs = cell_.rendered ? rendered(truth, scene.X_NB, off, seed, rng)
                                 : projected(cell_, truth, scene.X_NB, off, rng);
    const bool color = cell_.body != Body::infrared;
    for (Blob& blob : scene.blobs) {
      if (!color) {
        blob.color = LedColor::none;
      } else if (rng.chance(cell_.lying)) {
        blob.color = rng.chance(0.7)               ? LedColor::white
                     : blob.color == LedColor::red ? LedColor::green
                                                   : LedColor::red;
      }
    }
    Vector2 middle(rng.uniform(0, 848), rng.uniform(0, 480));
    for (int k = 0; k < cell_.strays; ++k) {
      if (k % 12 == 0) middle = {rng.uniform(0, 848), rng.uniform(0, 480)};
      Vector2 uv(rng.uniform(0, 848), rng.uniform(0, 480));
      if (cell_.clustered) uv = middle + 25 * Vector2(rng.normal(), rng.normal());
      if (uv.x() < 0 || uv.y() < 0 || uv.x() > 847 || uv.y() > 479) continue;
      scene.blobs.push_back(light(uv, color ? lamp(rng) : LedColor::none,
                                  1500 * std::exp(0.8 * rng.normal()), rng));
    }
    return scene;
  }

 private:
  std::vector<Blob> rendered(const Rig& truth, const Pose& X_NB,
                             const std::vector<bool>& off, std::uint64_t seed,
                             Rng& rng) {
    Rig lit = truth;
    lit.leds.leds.clear();
    for (int i = 0; i < truth.leds.size(); ++i) {
      Led led = truth.leds.leds[static_cast<std::size_t>(i)];
      if (off[static_cast<std::size_t>(i)]) continue;
      if (led.color == LedColor::none)
        led.color = i % 2 == 0 ? LedColor::green : LedColor::red;
      lit.leds.leds.push_back(led);
    }
    CameraSimConfig config;
    config.lights = cell_.room_lights;
    auto renderer = CameraRenderer::create(config, lit, seed);
    if (!renderer) {
      std::fprintf(stderr, "%s\n", renderer.error().detail.c_str());
      std::abort();
    }
    const Vector3 v =
        cell_.speed *
        Vector3(rng.normal(), rng.normal(), 0.3 * rng.normal()).normalized();
    SceneAt begin, end;
    begin.X_NB = end.X_NB = X_NB;
    begin.X_NB.translation() -= 0.001 * v;
    end.X_NB.translation() += 0.001 * v;
    const SceneAt exposure[] = {begin, end};
    if (!renderer->render(seed, exposure, buffer_)) std::abort();
    const auto blobs = detector_.detect(buffer_.view());
    if (!blobs) return {};
    return {blobs->begin(), blobs->end()};
  }

  Cell cell_;
  BlobDetector detector_;
  ColorBuffer buffer_;
};

bool wrong(const Pose& a, const Pose& b) {
  return (a.translation() - b.translation()).norm() > 0.15 ||
         angle_between(a.linear(), b.linear()) > 15 * kDegree;
}

void run(const Cell& cell, std::uint64_t first, std::uint64_t count) {
  Stage stage(cell);
  int right = 0, none = 0, bad = 0;
  int right_by_range[3] = {}, total_by_range[3] = {};
  int four_blobs = 0;
  std::vector<double> us;
  std::string bad_seeds;
  std::optional<LedFinder> finder;
  Rig rig = rig_of(cell, 0);
  for (std::uint64_t seed = first; seed < first + count; ++seed) {
    const std::uint64_t per_rig = std::max<std::uint64_t>(count / 6, 1);
    const bool new_rig = cell.body == Body::random && (seed - first) % per_rig == 0;
    if (!finder || new_rig) {
      rig = rig_of(cell, seed);
      LedFinderConfig config;
      if (cell.body == Body::ring) config.facing_max_deg = 180;
      auto made = LedFinder::create(config, rig.camera, rig.leds, rig.pad.size_m);
      if (!made) {
        std::printf("%s: %s\n", cell.name, made.error().detail.c_str());
        return;
      }
      finder.emplace(std::move(*made));
    }
    const Drawn scene = stage.draw(rig, seed);
    const double before = thread_cpu_us();
    const auto found = finder->find(scene.blobs);
    us.push_back(thread_cpu_us() - before);
    const double range =
        (scene.X_NB.translation() - rig.camera.X_NC.translation()).norm();
    const int bin = range < 1.2 ? 0 : range < 2.2 ? 1 : 2;
    ++total_by_range[bin];
    four_blobs += static_cast<int>(scene.blobs.size()) - cell.strays < 5;
    if (!found) {
      ++none;
    } else if (wrong(found->fit.X_NB, scene.X_NB)) {
      ++bad;
      char text[160];
      std::snprintf(
          text, sizeof text,
          "    wrong: seed %lu, %.2f m, off %.2f m %.0f deg, %d LEDs\n",
          static_cast<unsigned long>(seed), range,
          (found->fit.X_NB.translation() - scene.X_NB.translation()).norm(),
          angle_between(found->fit.X_NB.linear(), scene.X_NB.linear()) / kDegree,
          found->frame.led_count());
      if (bad <= 12) bad_seeds += text;
    } else {
      ++right;
      ++right_by_range[bin];
    }
  }
  std::sort(us.begin(), us.end());
  const auto at = [&](double share) {
    return us[static_cast<std::size_t>(share * static_cast<double>(us.size() - 1))];
  };
  const auto share = [](int a, int b) { return b > 0 ? 100.0 * a / b : 0.0; };
  const auto total = static_cast<int>(count);
  std::printf(
      "%-24s %6.2f %6.2f %6.2f  | %6.1f %6.1f %6.1f | %6.1f | %7.0f %7.0f %7.0f\n",
      cell.name, share(right, total), share(none, total), share(bad, total),
      share(right_by_range[0], total_by_range[0]),
      share(right_by_range[1], total_by_range[1]),
      share(right_by_range[2], total_by_range[2]), share(four_blobs, total), at(0.5),
      at(0.99), us.back());
  std::fputs(bad_seeds.c_str(), stdout);
  std::fflush(stdout);
}

}  // namespace
}  // namespace alight

int main(int argc, char** argv) {
  const auto number = [&](int i, std::uint64_t otherwise) {
    return argc > i ? std::strtoull(argv[i], nullptr, 10) : otherwise;
  };
  const std::string only = argc > 3 ? argv[3] : "";
  std::printf("%-24s %6s %6s %6s  | %20s | %6s | %23s\n", "%", "right", "none", "wrong",
              "right <1.2 <2.2 <3.2", "<5 seen", "us p50     p99     max");
  for (const alight::Cell& cell : alight::kCells) {
    const bool exact = !only.empty() && only.back() == '.';
    const std::string name = std::string(cell.name) + (exact ? "." : "");
    if (exact ? name == only : name.find(only) != std::string::npos) {
      alight::run(cell, number(2, 1), number(1, 1000));
    }
  }
}
