#include "alight/run/sequence.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "alight/base/bounds.h"
#include "alight/io/files.h"
#include "alight/io/image_io.h"
#include "alight/io/pose_log.h"
#include "alight/io/rig_yaml.h"
#include "alight/run/source_folder.h"
#include "alight/sim/camera_lights.h"
#include "alight/sim/true_rig.h"

namespace alight {
namespace {

constexpr Seconds kShortestPath = 10;  // a shorter sequence is the begin of such a one
constexpr int kInstants = 5;           // of an exposure
constexpr int kHardJpeg = 80;
constexpr double kHardShotNoise = 5;
constexpr double kHardSpread = 3;  // brightest LED over dimmest

/// Brightness of the LEDs, evenly spread on a logarithmic scale from 1 / sqrt(3) to
/// sqrt(3), the ends included, in an order drawn.
void spread_brightness(int leds, Rng rng, std::array<double, kMaxLeds>& gain) {
  std::vector<double> level;
  for (int i = 0; i < leds; ++i) {
    const double share = leds > 1 ? static_cast<double>(i) / (leds - 1) : 0.5;
    level.push_back(std::pow(kHardSpread, share - 0.5));
  }
  for (int i = 0; i < leds; ++i) {
    const auto left = static_cast<double>(leds - i);
    const auto pick =
        static_cast<std::size_t>(i) + static_cast<std::size_t>(rng.uniform(0, left));
    std::swap(level[static_cast<std::size_t>(i)], level[pick]);
    gain[static_cast<std::size_t>(i)] = level[static_cast<std::size_t>(i)];
  }
}

CameraSimConfig camera_config(const SequenceOptions& options, const Rng& rng) {
  CameraSimConfig config;
  config.led_axis_B = leds_face(options.rig);
  config.lights = options.lights;
  config.pad_reflectance = 0.2;
  if (options.kind == SequenceKind::hard) {
    config.shot_noise = kHardShotNoise;
    config.led_brightness_spread = 0;
    spread_brightness(options.rig.leds.size(), rng.fork("brightness"), config.led_gain);
  }
  for (const int i : options.dead) config.led_gain[static_cast<std::size_t>(i)] = 0;
  return config;
}

/// A lamp somewhere in the picture taken from `X_IC`: mostly white, some of the colours
/// of LEDs.
RoomLight stray(const Intrinsics& lens, const Pose& X_IC, Rng& rng) {
  RoomLight light;
  const double border = 10;
  const double u = rng.uniform(border, lens.width - border);
  const double v = rng.uniform(border, lens.height - border);
  const double far = rng.uniform(3, 9);
  light.p_IA = X_IC * Vector3(far * lens.unproject({u, v}));
  light.p_IB = light.p_IA + Vector3(0, 0, 1e-3);
  light.width_m = 0.01;
  light.brightness = std::exp(rng.uniform(std::log(2e3), std::log(6e4)));
  constexpr LedColor kColors[] = {LedColor::white, LedColor::white, LedColor::none,
                                  LedColor::red,   LedColor::green, LedColor::blue};
  light.bgr = sensor_response(kColors[static_cast<std::size_t>(rng.uniform(0, 6))]);
  return light;
}

std::string frame_name(int k, bool jpeg) {
  char name[32];
  std::snprintf(name, sizeof(name), "frame_%05d.%s", k, jpeg ? "jpg" : "png");
  return name;
}

std::string seconds_text(Time t) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.9f", to_seconds(t));
  return text;
}

std::string truth_line(Time t, const RelativeState& x) {
  Eigen::Quaterniond q(x.R_NB);
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  char text[320];
  std::snprintf(text, sizeof(text),
                "%s,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f,%.9f\n",
                seconds_text(t).c_str(), x.p_NB.x(), x.p_NB.y(), x.p_NB.z(), q.x(),
                q.y(), q.z(), q.w(), x.v_NB.x(), x.v_NB.y(), x.v_NB.z());
  return text;
}

}  // namespace

const char* to_string(SequenceKind kind) {
  return kind == SequenceKind::hard ? "hard" : "clean";
}

std::optional<SequenceKind> sequence_kind(std::string_view name) {
  for (const SequenceKind kind : {SequenceKind::clean, SequenceKind::hard}) {
    if (name == to_string(kind)) return kind;
  }
  return std::nullopt;
}

Result<void> SequenceOptions::validate() const {
  if (auto good = rig.validate(); !good) return good;
  if (auto good = path.validate(); !good) return good;
  for (const int i : dead) {
    if (i < 0 || i >= rig.leds.size()) {
      return fail(Fault::invalid_config, "dead: LED " + std::to_string(i) +
                                             " is not in the rig, its LEDs are 0 to " +
                                             std::to_string(rig.leds.size() - 1));
    }
  }
  return check_bounds({{"frames", static_cast<double>(frames), 1, kFramesMost},
                       {"platform_speed_m_s", platform_speed_m_s, 0, 10},
                       {"lights", static_cast<double>(lights), 0, kLightsMost},
                       {"strays", static_cast<double>(strays), 0, kLightsMost},
                       {"dark_from", dark_from, 0, 1e6},
                       {"dark_to", dark_to, dark_from, 1e6},
                       {"led_error_mm", led_error_mm, 0, kLedErrorMost_mm}});
}

Sequence::Sequence(const SequenceOptions& options, FlightPath path, Rig true_rig)
    : options_(options), path_(path), true_rig_(std::move(true_rig)) {}

Result<Sequence> Sequence::create(const SequenceOptions& options) {
  if (auto good = options.validate(); !good) return fail(good.error());
  const Rng rng = Rng(options.seed).fork("sequence");
  RigErrorScenario error{0, 0, 0, 0, 0, 0, 0, 0, 0};
  error.led_mm = options.led_error_mm;
  Rig true_rig = draw_true_rig(options.rig, error, rng.fork("rig")).rig;

  const Seconds duration = options.frames / options.rig.timing.rate_hz;
  auto path = FlightPath::draw(options.path, true_rig,
                               std::max(duration, kShortestPath), rng.fork("path"));
  if (!path) return fail(path.error());
  Sequence sequence(options, *path, std::move(true_rig));
  if (auto good = sequence.make_renderers(rng); !good) return fail(good.error());
  return sequence;
}

Result<void> Sequence::make_renderers(const Rng& rng) {
  Rng drive = rng.fork("drive");
  const double heading = drive.uniform(0, 2 * kPi);
  const double speed = drive.uniform(0, options_.platform_speed_m_s);
  platform_velocity_ = speed * Vector3(std::cos(heading), std::sin(heading), 0);
  jpeg_ = options_.kind == SequenceKind::hard ? kHardJpeg : 0;

  std::vector<RoomLight> strays;
  Rng lamps = rng.fork("strays");
  const Pose X_IC = scene(0).X_IN * true_rig_.camera.X_NC;
  for (int i = 0; i < options_.strays; ++i) {
    strays.push_back(stray(true_rig_.camera.intrinsics, X_IC, lamps));
  }
  CameraSimConfig config = camera_config(options_, rng);
  const auto lit = config.led_gain;
  for (const bool dark : {false, true}) {
    for (const int jpeg : {0, jpeg_}) {
      config.jpeg = jpeg;
      config.led_gain = dark ? CameraSimConfig::all_leds(0) : lit;
      auto renderer = CameraRenderer::create(config, true_rig_, options_.seed);
      if (!renderer) return fail(renderer.error());
      for (const RoomLight& light : strays) renderer->add_light(light);
      renderers_.push_back(std::move(*renderer));
    }
  }
  return {};
}

Time Sequence::time(int k) const {
  return from_seconds(kBegin + k / options_.rig.timing.rate_hz);
}

SceneAt Sequence::scene(Seconds t) const {
  SceneAt scene;
  scene.X_IN.translation() = platform_velocity_ * t;
  scene.X_NB = path_.at(t).X_NB();
  return scene;
}

Result<void> Sequence::render(int k, ColorBuffer& color, Compression compression) {
  const Seconds t = to_seconds(time(k)) - kBegin;
  const Seconds span = span_of(options_.rig.timing);
  std::array<SceneAt, kInstants> scenes;
  for (std::size_t i = 0; i < kInstants; ++i) {
    const double share = static_cast<double>(i) / (kInstants - 1) - 0.5;
    scenes[i] = scene(t + share * span);
  }
  const bool dark = t >= options_.dark_from && t < options_.dark_to;
  const bool compressed = compression == Compression::applied;
  const std::size_t which = (dark ? 2u : 0u) + (compressed ? 1u : 0u);
  return renderers_[which].render(static_cast<std::uint64_t>(k), scenes, color);
}

Result<std::string> save_sequence(const std::string& folder,
                                  const SequenceOptions& options,
                                  const std::function<void(int)>& progress) {
  auto sequence = Sequence::create(options);
  if (!sequence) return fail(sequence.error());
  if (auto good = begin_source(folder); !good) return fail(good.error());
  const bool jpeg = sequence->jpeg() > 0;
  std::string list = "t,file\n";
  std::string truth = "t,x,y,z,qx,qy,qz,qw,vx,vy,vz\n";
  PoseLog poses;
  double nearest = 1e9, farthest = 0, fastest = 0;
  const Vector3 p_NC = sequence->true_rig().camera.X_NC.translation();
  ColorBuffer color;
  for (int k = 0; k < sequence->frames(); ++k) {
    if (auto good = sequence->render(k, color, Sequence::Compression::left_out);
        !good) {
      return fail(good.error());
    }
    const std::string name = frame_name(k, jpeg);
    const std::string path = folder + "/" + name;
    if (auto good = jpeg ? save_jpeg(path, color.view(), sequence->jpeg())
                         : save_png(path, color.view());
        !good) {
      return fail(good.error());
    }
    const Time t = sequence->time(k);
    const RelativeState x = sequence->truth(k);
    list += seconds_text(t) + "," + name + "\n";
    truth += truth_line(t, x);
    poses.emplace_back(t, x.X_NB());
    nearest = std::min(nearest, (x.p_NB - p_NC).norm());
    farthest = std::max(farthest, (x.p_NB - p_NC).norm());
    fastest = std::max(fastest, x.v_NB.norm());
    if (progress) progress(k + 1);
  }
  const nlohmann::ordered_json summary{{"kind", to_string(options.kind)},
                                       {"seed", options.seed},
                                       {"frames", options.frames},
                                       {"lights", options.lights},
                                       {"strays", options.strays},
                                       {"dead", options.dead},
                                       {"dark_s", {options.dark_from, options.dark_to}},
                                       {"led_error_mm", options.led_error_mm},
                                       {"range_m", {nearest, farthest}},
                                       {"speed_max_m_s", fastest},
                                       {"close_share", sequence->path().close_share()}};
  const std::string text = summary.dump(2) + "\n";
  const std::pair<const char*, std::string> files[] = {
      {"frames.csv", list},
      {"truth.csv", truth},
      {"truth.tum", tum_text(poses)},
      {"rig.yaml", rig_text(options.rig)},
      {"rig_true.yaml", rig_text(sequence->true_rig())},
      {"sequence.json", text}};
  for (const auto& [name, content] : files) {
    if (auto good = write_file(folder + "/" + name, content); !good) {
      return fail(good.error());
    }
  }
  return text;
}

}  // namespace alight
