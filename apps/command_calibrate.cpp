#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>

#include "alight/io/files.h"
#include "alight/io/rig_yaml.h"
#include "alight/io/text.h"
#include "alight/run/calibrate_run.h"
#include "checks.h"
#include "command.h"
#include "rig_option.h"

using namespace alight;

namespace {

struct Files {
  std::string source, rig, out;
  bool json = false;
};

struct FlightSettings : Files {
  std::vector<std::string> distances;
  double distance_sd_mm = 0.2;
  double led_sd_mm = 3;
  int hold_out = 5;
  bool depth = false;
  bool merged = false;
  bool no_thrust = false;
};

struct LensSettings : Files {
  std::string board, charuco;
  double square_mm = 25;
  double marker_share = 0.75;
  bool k3 = false;
};

struct MountSettings : Files {
  std::vector<std::string> sources;
  bool parked = false;
  std::vector<double> headings_deg;
  double place_sd_mm = 5, heading_sd_deg = 2, tilt_sd_deg = 1.5, led_sd_mm = 1;
  double tag_mm = 0;
  std::string family = "4x4_50";
  int tag_id = 0;
  std::vector<double> tag_at{0, 0, 0, 0, 0, -90};
};

/// "i,j=m"
bool read_distance(const std::string& text, LedDistance& out) {
  const auto sides = split(text, '=');
  if (sides.size() != 2) return false;
  const auto ends = split(sides[0], ',');
  double i = 0, j = 0;
  if (ends.size() != 2 || !parse_number(ends[0], i) || !parse_number(ends[1], j) ||
      !parse_number(sides[1], out.distance_m)) {
    return false;
  }
  if (i != std::floor(i) || j != std::floor(j) || std::min(i, j) < 0 ||
      std::max(i, j) >= kMaxLeds || out.distance_m <= 0) {
    return false;
  }
  out.i = static_cast<int>(i);
  out.j = static_cast<int>(j);
  return true;
}

std::string is_distance(const std::string& text) {
  LedDistance distance;
  if (read_distance(text, distance)) return {};
  return alight::quoted(text) + " is not I,J=METRES, as in 0,5=0.152";
}

/// "9x6"
bool read_size(const std::string& text, int& columns, int& rows) {
  const auto sides = split(text, 'x');
  double c = 0, r = 0;
  if (sides.size() != 2 || !parse_number(sides[0], c) || !parse_number(sides[1], r) ||
      c != std::floor(c) || r != std::floor(r) || c < 3 || r < 3 || c > 50 || r > 50) {
    return false;
  }
  columns = static_cast<int>(c);
  rows = static_cast<int>(r);
  return true;
}

std::string is_size(const std::string& text) {
  int columns = 0, rows = 0;
  if (read_size(text, columns, rows)) return {};
  return alight::quoted(text) + " is not COLUMNSxROWS, as in 9x6, each from 3 to 50";
}

void print_size(const ConstellationFit& fit) {
  switch (fit.size_from) {
    case SizeFrom::distances:
      std::printf("size          from --distance, +- %.2f %%\n", 100 * fit.size_sd);
      break;
    case SizeFrom::depth:
      std::printf(
          "size          from depth (which reads %.4f of the true), +- %.2f %%\n",
          fit.depth_scale, 100 * fit.size_sd);
      break;
    case SizeFrom::prior:
      std::printf(
          "size          from the rig file, +- %.2f %%: pictures cannot tell a "
          "large drone far away\n"
          "              from a small one near; give --distance I,J=METRES\n",
          100 * fit.size_sd);
      break;
  }
}

void print(const FlightSettings& settings, const Rig& before,
           const CalibrateFlightResult& result) {
  const ConstellationFit& fit = result.fit;
  std::printf(
      "%s: %d pictures, the drone in %d of them; %d used, %d that contradict "
      "them dropped\n",
      settings.source.c_str(), result.pictures, result.seen, fit.frames,
      fit.frames_dropped);
  std::printf(
      "fit           %.2f px rms before, %.2f after; %.2f in %d pictures held "
      "out\n",
      fit.rms_before_px, fit.rms_px, fit.rms_held_out_px, fit.frames_held_out);
  std::printf(
      "LED          x, mm             y, mm             z, mm       moved, mm   "
      "seen alone\n");
  for (int i = 0; i < fit.leds.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    std::printf("%3d", i);
    for (int k = 0; k < 3; ++k) {
      std::printf("  %7.2f +- %.2f", fit.leds.p_BL(i)[k] * 1e3, fit.sd_m[n][k] * 1e3);
    }
    std::printf("  %9.2f   %9d\n",
                (fit.leds.p_BL(i) - before.leds.p_BL(i)).norm() * 1e3, fit.alone[n]);
  }
  print_size(fit);
  const Vector3 turn = fit.turn_sd_rad / kDegree;
  if (fit.thrust) {
    const Vector2 told = fit.thrust->turn_rad / kDegree;
    const Vector2 sd = fit.thrust->cov.diagonal().cwiseSqrt() / kDegree;
    std::printf(
        "thrust        turns the whole by %.1f +- %.1f deg about x, %.1f +- %.1f about "
        "y (%d stretches of flight)\n",
        told.x(), sd.x(), told.y(), sd.y(), fit.thrust->windows);
  } else {
    std::printf("thrust        does not tell how the whole is turned: %s\n",
                fit.no_thrust.c_str());
  }
  std::printf(
      "as a whole    placed in B by the rig file: +- %.1f %.1f %.1f mm, turned "
      "+- %.1f %.1f %.1f deg about x, y, z\n"
      "              (pictures cannot tell; it moves every pose alike)\n",
      fit.shift_sd_m.x() * 1e3, fit.shift_sd_m.y() * 1e3, fit.shift_sd_m.z() * 1e3,
      turn.x(), turn.y(), turn.z());
  std::printf("written to    %s\n", settings.out.c_str());
}

void print(const LensSettings& settings, const CalibrateLensResult& result) {
  const LensFit& fit = result.fit;
  std::printf("%s: %d pictures, the board in %d; %d views used, %d dropped\n",
              settings.source.c_str(), result.pictures, result.seen, fit.views,
              fit.views_dropped);
  std::printf(
      "fit           %.3f px rms before, %.3f after; %.3f in %d views held out\n",
      fit.rms_before_px, fit.rms_px, fit.rms_held_out_px, fit.views_held_out);
  std::printf(
      "seen          %.0f deg of tilt, %.0f %% of the width, %.0f %% of the "
      "height\n",
      fit.tilt_deg, 100 * fit.reach_u, 100 * fit.reach_v);
  const double values[] = {fit.lens.fx, fit.lens.fy, fit.lens.cx, fit.lens.cy};
  const char* names[] = {"fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"};
  for (std::size_t i = 0; i < kLensNumbers; ++i) {
    const double value = i < 4 ? values[i] : fit.lens.distortion[i - 4];
    if (i < 4) {
      std::printf("%-13s %.2f +- %.2f px\n", names[i], value, fit.sd[i]);
    } else {
      std::printf("%-13s %.5f +- %.5f%s\n", names[i], value, fit.sd[i],
                  i == 8 && !settings.k3 ? " (held at 0; --k3 fits it)" : "");
    }
  }
  std::printf("written to    %s\n", settings.out.c_str());
}

void print(const MountSettings& settings, const CalibrateMountResult& result) {
  const MountFit& fit = result.fit;
  const Vector3 p = housing_from_optical(fit.X_NC).translation();
  const Vector3 rpy = mount_rpy_deg(fit.X_NC);
  std::printf("%d pictures, %s in %d\n", result.pictures,
              settings.parked ? "the drone" : "the tag", result.seen);
  std::printf(
      "stands off    %.1f mm and %.2f deg from where it was placed before, %.1f "
      "mm and %.2f deg after\n",
      1e3 * fit.off_before_m, fit.off_before_deg, 1e3 * fit.off_m, fit.off_deg);
  if (std::isfinite(fit.off_held_out_m)) {
    std::printf("              %.1f mm and %.2f deg held out, each by the others\n",
                1e3 * fit.off_held_out_m, fit.off_held_out_deg);
  }
  const char* axes[] = {"x", "y", "z"};
  const char* turns[] = {"roll", "pitch", "yaw"};
  for (int i = 0; i < 3; ++i) {
    std::printf("%-13s %.4f +- %.4f m\n", axes[i], p[i], fit.position_sd_m[i]);
  }
  for (int i = 0; i < 3; ++i) {
    std::printf("%-13s %.2f +- %.2f deg\n", turns[i], rpy[i], fit.rpy_sd_deg[i]);
  }
  if (settings.parked && settings.sources.size() == 1) {
    std::printf(
        "one parking   forward, left and heading are known only as well as the "
        "drone was parked;\n"
        "              park it at several headings, turned about the pad's "
        "centre, to know more\n");
  }
  std::printf("written to    %s\n", settings.out.c_str());
}

/// Writes the rig and says what was found.
template <class Options, class Outcome, class Print>
Result<void> conclude(const Files& files, const Options& options,
                      const Result<Outcome>& result, Print&& tell) {
  if (!result) return fail(result.error());
  // What the user wants when things go wrong stays as it was.
  const auto safety = load_safety(files.rig, options.rig);
  if (!safety) return fail(safety.error());
  if (auto good = save_rig(files.out, result->rig, *safety); !good) return good;
  if (files.json) {
    std::cout << calibration_json(options, *result);
  } else {
    tell(*result);
  }
  return {};
}

Result<void> calibrate(const FlightSettings& settings) {
  if (auto good = check_file(settings.out); !good) return good;
  CalibrateFlightOptions options;
  auto rig = load_seen_rig(settings.rig, "calibrate");
  if (!rig) return fail(rig.error());
  options.rig = *rig;
  options.source = settings.source;
  auto& adjustment = options.config.adjustment;
  for (const std::string& text : settings.distances) {
    LedDistance distance;
    if (!read_distance(text, distance)) return fail(Fault::invalid_config, text);
    distance.sd_m = settings.distance_sd_mm * 1e-3;
    adjustment.distances.push_back(distance);
  }
  adjustment.led_sd_m = settings.led_sd_mm * 1e-3;
  adjustment.use_depth = settings.depth;
  options.config.hold_out = settings.hold_out;
  options.config.use_merged = settings.merged;
  options.config.use_thrust = !settings.no_thrust;
  return conclude(settings, options, calibrate_flight(options),
                  [&](const auto& result) { print(settings, *rig, result); });
}

Result<void> calibrate(const LensSettings& settings) {
  if (auto good = check_file(settings.out); !good) return good;
  CalibrateLensOptions options;
  auto rig = load_rig(settings.rig);
  if (!rig) return fail(rig.error());
  options.rig = *rig;
  options.source = settings.source;
  const bool charuco = !settings.charuco.empty();
  options.board.kind = charuco ? BoardSpec::Kind::charuco : BoardSpec::Kind::chessboard;
  (void)read_size(charuco ? settings.charuco : settings.board, options.board.columns,
                  options.board.rows);
  options.board.square_m = settings.square_mm * 1e-3;
  options.board.marker_share = settings.marker_share;
  options.config.fit_k3 = settings.k3;
  return conclude(settings, options, calibrate_lens(options),
                  [&](const auto& result) { print(settings, result); });
}

Result<void> calibrate(const MountSettings& settings) {
  if (auto good = check_file(settings.out); !good) return good;
  CalibrateMountOptions options;
  auto rig = settings.parked ? load_seen_rig(settings.rig, "calibrate")
                             : load_rig(settings.rig);
  if (!rig) return fail(rig.error());
  options.rig = *rig;
  options.sources = settings.sources;
  options.headings_deg = settings.headings_deg;
  options.led_sd_m = settings.led_sd_mm * 1e-3;
  if (!settings.parked) {
    if (settings.sources.size() > 1) {
      return fail(Fault::invalid_config, "a tag stands in one place: give one SOURCE");
    }
    const auto& at = settings.tag_at;
    options.tag = PadTag{
        settings.family == "36h11" ? TagFamily::tag36h11 : TagFamily::dict_4x4_50,
        settings.tag_id, settings.tag_mm * 1e-3,
        make_pose(from_rpy(at[3] * kDegree, at[4] * kDegree, at[5] * kDegree),
                  Vector3(at[0], at[1], at[2]))};
    options.config = MountConfig::tag();
  } else {
    options.config.place_sd_m = settings.place_sd_mm * 1e-3;
    options.config.heading_sd_deg = settings.heading_sd_deg;
    options.config.tilt_sd_deg = settings.tilt_sd_deg;
  }
  return conclude(settings, options, calibrate_mount(options),
                  [&](const auto& result) { print(settings, result); });
}

template <class Settings>
CLI::App* add_part(CLI::App& parent, Job& job,
                   const std::shared_ptr<Settings>& settings, const char* name,
                   const char* what) {
  CLI::App* part = parent.add_subcommand(name, what);
  part->add_option("--rig", settings->rig, "Rig file")->required();
  part->add_option("--out", settings->out, "Rig file to write")
      ->required()
      ->check(named());
  part->add_flag("--json", settings->json, "One JSON document");
  part->callback(
      [settings, &job] { job = [settings] { return calibrate(*settings); }; });
  return part;
}

void add_constellation(CLI::App& parent, Job& job) {
  auto settings = std::make_shared<FlightSettings>();
  CLI::App* part = add_part(parent, job, settings, "constellation",
                            "Where the LEDs sit, from a recorded flight");
  part->add_option("SOURCE", settings->source,
                   "Folder with frames.csv, folder of pictures, or video")
      ->required();
  part->add_option("--distance", settings->distances,
                   "I,J=METRES between two LEDs, measured; may be given again")
      ->allow_extra_args(false)
      ->check(CLI::Validator(is_distance, "I,J=M"));
  part->add_option("--distance-sd-mm", settings->distance_sd_mm,
                   "How well it is measured, 1 sd")
      ->check(within(0.001, 50))
      ->capture_default_str();
  part->add_option("--led-sd-mm", settings->led_sd_mm,
                   "How well the rig file knows the LEDs, 1 sd of a coordinate")
      ->check(within(0.1, 20))
      ->capture_default_str();
  part->add_flag("--depth", settings->depth, "Size from the depth pictures");
  part->add_flag("--merged", settings->merged, "Use blobs of several LEDs, too");
  part->add_flag("--no-thrust", settings->no_thrust,
                 "Do not turn the whole so that the thrust lies along z of B");
  part->add_option("--hold-out", settings->hold_out,
                   "Every how many-th picture is held out")
      ->check(within(2, 100))
      ->capture_default_str();
}

void add_camera(CLI::App& parent, Job& job) {
  auto settings = std::make_shared<LensSettings>();
  CLI::App* part =
      add_part(parent, job, settings, "camera", "The lens, from pictures of a board");
  part->add_option("SOURCE", settings->source,
                   "Folder with frames.csv, folder of pictures, or video")
      ->required();
  auto* kind = part->add_option_group("board", "One of");
  kind->add_option("--board", settings->board,
                   "Chessboard by its inner corners: COLUMNSxROWS")
      ->check(CLI::Validator(is_size, "CxR"));
  kind->add_option("--charuco", settings->charuco,
                   "ChArUco board (4x4_50) by its squares: COLUMNSxROWS")
      ->check(CLI::Validator(is_size, "CxR"));
  kind->require_option(1);
  part->add_option("--square-mm", settings->square_mm, "Side of a square")
      ->check(within(1, 1000))
      ->required();
  part->add_option("--marker-share", settings->marker_share,
                   "ChArUco: side of a marker over that of a square")
      ->check(within(0.3, 0.95))
      ->capture_default_str();
  part->add_flag("--k3", settings->k3, "Fit the third radial term (wide lenses)");
}

void add_mount(CLI::App& parent, Job& job) {
  auto settings = std::make_shared<MountSettings>();
  CLI::App* part = add_part(parent, job, settings, "mount",
                            "Where the camera sits, from a tag or the parked drone");
  part->add_option("SOURCE", settings->sources,
                   "Pictures of the tag, or of each parking of the drone")
      ->required();
  auto* kind = part->add_option_group("what", "One of");
  kind->add_flag("--parked", settings->parked, "The drone stands on the pad");
  kind->add_option("--tag-mm", settings->tag_mm,
                   "A tag, by the side of its black square")
      ->check(within(5, 2000));
  kind->require_option(1);
  part->add_option("--heading-deg", settings->headings_deg,
                   "Parked: headings about z of N, one a SOURCE (all 0)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->check(within(-360, 360));
  part->add_option("--place-sd-mm", settings->place_sd_mm,
                   "Parked: how well over the centre, 1 sd")
      ->check(within(0.1, 200))
      ->capture_default_str();
  part->add_option("--heading-sd-deg", settings->heading_sd_deg,
                   "Parked: how well turned, 1 sd")
      ->check(within(0.05, 30))
      ->capture_default_str();
  part->add_option("--tilt-sd-deg", settings->tilt_sd_deg,
                   "Parked: LED frame against the feet, 1 sd")
      ->check(within(0.05, 20))
      ->capture_default_str();
  part->add_option("--led-sd-mm", settings->led_sd_mm,
                   "Parked: how well the rig file knows the LEDs, 1 sd")
      ->check(within(0.01, 20))
      ->capture_default_str();
  part->add_option("--tag-family", settings->family, "4x4_50 or 36h11")
      ->check(CLI::IsMember({"4x4_50", "36h11"}))
      ->capture_default_str();
  part->add_option("--tag-id", settings->tag_id, "Number of the tag")
      ->check(within(0, 586))
      ->capture_default_str();
  part->add_option("--tag-at", settings->tag_at,
                   "x,y,z (m), roll,pitch,yaw (deg) of the tag in N; as given, it lies "
                   "on the centre, its top edge to the front")
      ->delimiter(',')
      ->expected(6)
      ->check(finite());
}

}  // namespace

void add_calibrate(CLI::App& app, Job& job) {
  CLI::App* command =
      app.add_subcommand("calibrate", "A rig measured: constellation, camera or mount");
  command->require_subcommand(1);
  add_constellation(*command, job);
  add_camera(*command, job);
  add_mount(*command, job);
}
