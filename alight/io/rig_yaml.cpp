#include "alight/io/rig_yaml.h"

#include <cmath>

#include "alight/io/files.h"
#include "alight/io/text.h"
#include "alight/io/yaml_reader.h"

namespace alight {
namespace {

void read_camera(YamlMap map, Rig& rig) {
  Intrinsics& lens = rig.camera.intrinsics;
  CameraTiming& timing = rig.timing;
  for (const char* key : {"width", "height", "fx", "fy", "cx", "cy"}) map.require(key);
  map.read("width", lens.width);
  map.read("height", lens.height);
  map.read("fx", lens.fx);
  map.read("fy", lens.fy);
  map.read("cx", lens.cx);
  map.read("cy", lens.cy);
  map.read("distortion", lens.distortion);
  map.read("rate_hz", timing.rate_hz);
  map.read("exposure_ms", timing.exposure_ms);
  map.read("readout_ms", timing.readout_ms);
  map.read("frame_to_use_ms", timing.frame_to_use_ms);
  map.read_choice("mosaic", rig.mosaic,
                  {{"none", Mosaic::none},
                   {"rggb", Mosaic::rggb},
                   {"bggr", Mosaic::bggr},
                   {"grbg", Mosaic::grbg},
                   {"gbrg", Mosaic::gbrg}});
  map.read("gamma", rig.gamma);
}

void read_mount(YamlMap map, Pose& X_NC) {
  Vector3 p_NH = Vector3::Zero();
  Vector3 rpy_deg = Vector3::Zero();
  map.require("xyz_m");
  map.require("rpy_deg");
  map.read("xyz_m", p_NH);
  map.read("rpy_deg", rpy_deg);
  const Vector3 rpy = rpy_deg * kDegree;
  X_NC = optical_from_housing(make_pose(from_rpy(rpy[0], rpy[1], rpy[2]), p_NH));
}

void add_led(YamlMap& file, const char* key, const Led& led, Constellation& leds) {
  if (leds.leds.push_back(led)) return;
  file.complain(key, "more than " + std::to_string(kMaxLeds) + " LEDs");
}

void read_leds(YamlMap& file, Constellation& leds) {
  leds.leds.clear();
  for (YamlMap& item : file.list("leds")) {
    Led led;
    item.require("xyz_m");
    item.read("xyz_m", led.p_BL);
    item.read_choice("color", led.color,
                     {{"none", LedColor::none},
                      {"red", LedColor::red},
                      {"green", LedColor::green},
                      {"blue", LedColor::blue},
                      {"white", LedColor::white}});
    add_led(file, "leds", led, leds);
  }
  for (YamlMap& item : file.list("marker_positions")) {
    Led led;
    for (const char* key : {"x", "y", "z"}) item.require(key);
    item.read("x", led.p_BL[0]);
    item.read("y", led.p_BL[1]);
    item.read("z", led.p_BL[2]);
    add_led(file, "marker_positions", led, leds);
  }
  if (file.has("leds") && file.has("marker_positions")) {
    file.complain("marker_positions", "stands beside leds: keep one of the two");
  } else if (!file.has("leds") && !file.has("marker_positions")) {
    file.complain({}, "leds is missing (or marker_positions)");
  }
}

void read_drone(YamlMap map, DroneSpec& drone) {
  map.read("size_m", drone.size_m);
  map.read("mass_kg", drone.mass_kg);
  map.read("inertia_kg_m2", drone.inertia_kg_m2);
  map.read("arm_m", drone.arm_m);
  map.read("propeller_radius_m", drone.propeller_radius_m);
  map.read("motor_ms", drone.motor_ms);
  map.read("thrust_to_weight", drone.thrust_to_weight);
  map.read("tilt_max_deg", drone.tilt_max_deg);
  map.read("gear_height_m", drone.gear_height_m);
}

void read_led_frame(YamlMap map, LedFrameSpec& frame) {
  Vector3 xyz_sd_mm = Vector3::Zero(), turn_sd_deg = Vector3::Zero();
  double size_sd_percent = 0;
  map.read("xyz_sd_mm", xyz_sd_mm);
  map.read("turn_sd_deg", turn_sd_deg);
  map.read("size_sd_percent", size_sd_percent);
  frame = {1e-3 * xyz_sd_mm, turn_sd_deg * kDegree, 1e-2 * size_sd_percent};
}

void read_pad(YamlMap map, PadSpec& pad) {
  map.read("size_m", pad.size_m);
  map.read("above_floor_m", pad.above_floor_m);
  for (YamlMap& item : map.list("obstacles")) {
    Obstacle box;
    item.require("min_m");
    item.require("max_m");
    item.read("min_m", box.min_m);
    item.read("max_m", box.max_m);
    pad.obstacles.push_back(box);
  }
}

void read_tag(YamlMap map, Tag& tag) {
  Vector3 p_BT = Vector3::Zero();
  Vector3 rpy_deg = Vector3::Zero();
  for (const char* key : {"family", "id", "size_m", "xyz_m", "rpy_deg"}) {
    map.require(key);
  }
  map.read_choice(
      "family", tag.family,
      {{"DICT_4X4_50", TagFamily::dict_4x4_50}, {"tag36h11", TagFamily::tag36h11}});
  map.read("id", tag.id);
  map.read("size_m", tag.size_m);
  map.read("xyz_m", p_BT);
  map.read("rpy_deg", rpy_deg);
  const Vector3 rpy = rpy_deg * kDegree;
  tag.X_BT = make_pose(from_rpy(rpy[0], rpy[1], rpy[2]), p_BT);
}

void read_safety(YamlMap map, Safety& safety) {
  map.read("battery_low", safety.battery_low);
  map.read("battery_empty", safety.battery_empty);
  map.read_choice(
      "when_battery_low", safety.when_battery_low,
      {{"finish", WhenBatteryLow::finish}, {"leave", WhenBatteryLow::leave}});
  map.read("landings_max", safety.landings_max);
  map.read_choice("when_failed", safety.when_failed,
                  {{"hold", WhenFailed::hold}, {"leave", WhenFailed::leave}});
  map.read("leave_at_m", safety.leave_at_m);
}

std::string list_text(const double* values, int count) {
  std::string text(1, '[');
  for (int i = 0; i < count; ++i) text += (i ? ", " : "") + number_text(values[i]);
  return text += ']';
}
std::string list_text(const Vector3& v) { return list_text(v.data(), 3); }

/// Roll, pitch, yaw of R = Rz Ry Rx in deg; to 1e-9, so that what was read and is
/// written again is what was read.
Vector3 rpy_deg_of(const Matrix3& R) {
  const double level = std::hypot(R(0, 0), R(1, 0));
  Vector3 rpy(0, std::atan2(-R(2, 0), level), 0);
  if (level > 1e-9) {
    rpy[0] = std::atan2(R(2, 1), R(2, 2));
    rpy[2] = std::atan2(R(1, 0), R(0, 0));
  } else {
    rpy[2] = std::atan2(-R(0, 1), R(1, 1));  // straight up or down: roll is free
  }
  return (1e9 / kDegree * rpy).array().round() / 1e9;
}

}  // namespace

Result<Rig> load_rig(const std::string& path) {
  auto opened = YamlMap::load(path);
  if (!opened) return fail(opened.error());
  YamlMap& file = *opened;
  Rig rig = alan_rig();
  const bool layout_only = file.has("marker_positions") && !file.has("camera");
  if (!layout_only) {
    file.require("camera");
    file.require("mount");
  }
  if (file.has("camera")) {
    read_camera(file.map("camera"), rig);
  }
  if (file.has("mount")) read_mount(file.map("mount"), rig.camera.X_NC);
  read_leds(file, rig.leds);
  read_led_frame(file.map("led_frame"), rig.led_frame);
  read_drone(file.map("drone"), rig.drone);
  read_pad(file.map("pad"), rig.pad);
  YamlMap limits = file.map("limits");
  limits.read("speed_m_s", rig.limits.speed_m_s);
  limits.read("acceleration_m_s2", rig.limits.acceleration_m_s2);
  if (file.has("tag")) read_tag(file.map("tag"), rig.tag.emplace());
  Safety safety;  // load_safety's to keep; a wrong one is wrong for everybody
  read_safety(file.map("safety"), safety);
  if (const auto good = file.finish(); !good) return fail(good.error());
  for (const auto& good : {rig.validate(), safety.validate(rig)}) {
    if (!good) return fail(good.error().fault, path + ": " + good.error().detail);
  }
  return rig;
}

Result<Safety> load_safety(const std::string& path, const Rig& rig) {
  auto file = YamlMap::load(path);
  if (!file) return fail(file.error());
  Safety safety;
  read_safety(file->map("safety"), safety);
  if (const auto good = safety.validate(rig); !good) {
    return fail(good.error().fault, path + ": " + good.error().detail);
  }
  return safety;
}

std::string safety_text(const Safety& safety) {
  return "safety:\n  battery_low: " + number_text(safety.battery_low) +
         "\n  battery_empty: " + number_text(safety.battery_empty) +
         "\n  when_battery_low: " + to_string(safety.when_battery_low) +
         "\n  landings_max: " + std::to_string(safety.landings_max) +
         "\n  when_failed: " + to_string(safety.when_failed) +
         "  # or leave: fly to leave_at_m, in N, and land there\n  leave_at_m: " +
         list_text(safety.leave_at_m) + "  # zero: the follow point\n";
}

std::string rig_text(const Rig& rig) {
  const Intrinsics& k = rig.camera.intrinsics;
  const Pose X_NH = housing_from_optical(rig.camera.X_NC);
  std::string text = "camera:\n";
  const auto field = [&text](const char* key, double value) {
    text += std::string("  ") + key + ": " + number_text(value) + "\n";
  };
  const auto list = [&text](const char* key, const std::string& value) {
    text += std::string("  ") + key + ": " + value + "\n";
  };
  field("width", k.width);
  field("height", k.height);
  field("fx", k.fx);
  field("fy", k.fy);
  field("cx", k.cx);
  field("cy", k.cy);
  list("distortion", list_text(k.distortion.data(), 5));
  field("rate_hz", rig.timing.rate_hz);
  field("exposure_ms", rig.timing.exposure_ms);
  field("readout_ms", rig.timing.readout_ms);
  field("frame_to_use_ms", rig.timing.frame_to_use_ms);
  if (rig.mosaic != Mosaic::none) list("mosaic", to_string(rig.mosaic));
  if (rig.gamma != 0) field("gamma", rig.gamma);
  text += "mount:  # camera housing (x out of the lens, y left, z up) in N\n";
  list("xyz_m", list_text(X_NH.translation()));
  list("rpy_deg", list_text(rpy_deg_of(X_NH.linear())));
  text += "leds:  # in B\n";
  for (const Led& led : rig.leds.leds) {
    text += "  - {xyz_m: " + list_text(led.p_BL);
    if (led.color != LedColor::none) {
      text += std::string(", color: ") + to_string(led.color);
    }
    text += "}\n";
  }
  const LedFrameSpec& whole = rig.led_frame;
  if (!whole.exact()) {
    text += "led_frame:  # how well the LEDs as a whole are known, one sd\n";
    const auto rounded = [](double x) { return std::round(1e4 * x) / 1e4; };
    list("xyz_sd_mm", list_text(Vector3((1e3 * whole.shift_sd_m).unaryExpr(rounded))));
    list("turn_sd_deg",
         list_text(Vector3((whole.turn_sd_rad / kDegree).unaryExpr(rounded))));
    field("size_sd_percent", rounded(1e2 * whole.size_sd));
  }
  text += "drone:\n";
  field("size_m", rig.drone.size_m);
  field("mass_kg", rig.drone.mass_kg);
  list("inertia_kg_m2", list_text(rig.drone.inertia_kg_m2));
  field("arm_m", rig.drone.arm_m);
  field("propeller_radius_m", rig.drone.propeller_radius_m);
  field("motor_ms", rig.drone.motor_ms);
  field("thrust_to_weight", rig.drone.thrust_to_weight);
  field("tilt_max_deg", rig.drone.tilt_max_deg);
  field("gear_height_m", rig.drone.gear_height_m);
  text += "pad:\n";
  field("size_m", rig.pad.size_m);
  field("above_floor_m", rig.pad.above_floor_m);
  text += rig.pad.obstacles.empty() ? "  obstacles: []\n" : "  obstacles:\n";
  for (const Obstacle& box : rig.pad.obstacles) {
    text += "    - {min_m: " + list_text(box.min_m) +
            ", max_m: " + list_text(box.max_m) + "}\n";
  }
  text += "limits:\n";
  field("speed_m_s", rig.limits.speed_m_s);
  field("acceleration_m_s2", rig.limits.acceleration_m_s2);
  if (rig.tag) {
    text += "tag:  # seen x right, y up; in B\n";
    list("family", to_string(rig.tag->family));
    field("id", rig.tag->id);
    field("size_m", rig.tag->size_m);
    list("xyz_m", list_text(rig.tag->X_BT.translation()));
    list("rpy_deg", list_text(rpy_deg_of(rig.tag->X_BT.linear())));
  }
  return text;
}

Result<void> save_rig(const std::string& path, const Rig& rig, const Safety& safety) {
  return write_file(path, rig_text(rig) + safety_text(safety));
}

}  // namespace alight
