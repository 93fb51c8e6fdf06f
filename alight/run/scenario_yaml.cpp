#include "alight/run/scenario_yaml.h"

#include <filesystem>
#include <sstream>

#include "alight/io/files.h"
#include "alight/io/pose_log.h"
#include "alight/io/text.h"
#include "alight/io/yaml_reader.h"
#include "alight/sim/recorded_drive.h"

namespace alight {
namespace {

/// One description of the file serves reading and writing: `visit` names every field.
template <class Visitor>
void visit(Visitor& v, Scenario& s) {
  v.map("platform", [&](auto& m) {
    m.choice("kind", s.platform.kind,
             {PlatformKind::still, PlatformKind::straight, PlatformKind::circle,
              PlatformKind::block, PlatformKind::eight, PlatformKind::recorded,
              PlatformKind::boat});
    m.field("file", s.platform.file);
    m.field("speed_m_s", s.platform.speed_m_s);
    m.field("radius_m", s.platform.radius_m);
    m.field("side_m", s.platform.side_m);
    m.field("corner_radius_m", s.platform.corner_radius_m);
    m.field("brake_m_s2", s.platform.brake_m_s2);
    m.field("yaw_rate_max_deg_s", s.platform.yaw_rate_max_deg_s);
    m.map("sea", [&](auto& sea) {
      sea.field("heave_m", s.platform.sea.heave_m);
      sea.field("roll_deg", s.platform.sea.roll_deg);
      sea.field("pitch_deg", s.platform.sea.pitch_deg);
      sea.field("period_s", s.platform.sea.period_s);
      sea.field("gamma", s.platform.sea.gamma);
      sea.field("pad_above_m", s.platform.sea.pad_above_m);
      sea.field("pad_aft_m", s.platform.sea.pad_aft_m);
    });
  });
  v.map("start", [&](auto& m) {
    m.choice("place", s.start.place, {StartPlace::pad, StartPlace::floor});
    m.field("platform_moving", s.start.platform_moving);
  });
  v.map("wind", [&](auto& m) {
    m.field("mean_m_s", s.wind.mean_m_s);
    m.field("from_deg", s.wind.from_deg);
    m.choice("gusts", s.wind.gusts, {Gusts::none, Gusts::dryden});
  });
  v.map("radio", [&](auto& m) {
    m.field("latency_ms", s.radio.latency_ms);
    m.field("jitter_ms", s.radio.jitter_ms);
    m.field("loss", s.radio.loss);
    m.field("burst_ms", s.radio.burst_ms);
    m.field("queue", s.radio.queue);
  });
  v.map("camera", [&](auto& m) {
    m.field("lights", s.camera.lights);
    m.field("pad_reflectance", s.camera.pad_reflectance);
    m.field("jpeg", s.camera.jpeg);
    m.field("noise", s.camera.noise);
    m.field("gamma", s.camera.gamma);
    m.field("depth_offset_ms", s.camera.depth_offset_ms);
  });
  v.map("odometry", [&](auto& m) {
    m.field("rate_hz", s.odometry.rate_hz);
    m.field("latency_ms", s.odometry.latency_ms);
    m.field("scale_error", s.odometry.scale_error);
    m.field("yaw_rate_bias_deg_s", s.odometry.yaw_rate_bias_deg_s);
    m.field("slip", s.odometry.slip);
    m.field("imu_rate_hz", s.odometry.imu_rate_hz);
  });
  v.map("autopilot", [&](auto& m) {
    m.choice("interface", s.autopilot.interface,
             {AutopilotInterface::attitude, AutopilotInterface::velocity});
    m.field("heading_drift_deg_min", s.autopilot.heading_drift_deg_min);
    m.field("tilt_error_deg", s.autopilot.tilt_error_deg);
    m.field("external_pose", s.autopilot.external_pose);
    m.field("link_loss_ms", s.autopilot.link_loss_ms);
    m.choice("link_loss", s.autopilot.link_loss,
             {LinkLossAction::land, LinkLossAction::descend, LinkLossAction::drift});
    m.field("blind_after_ms", s.autopilot.blind_after_ms);
    m.field("land_speed_m_s", s.autopilot.land_speed_m_s);
    m.field("hover_error", s.autopilot.hover_error);
  });
  v.map("rig_error", [&](auto& m) {
    m.field("led_mm", s.rig_error.led_mm);
    m.field("led_frame_deg", s.rig_error.led_frame_deg);
    m.field("mount_mm", s.rig_error.mount_mm);
    m.field("mount_deg", s.rig_error.mount_deg);
    m.field("focal", s.rig_error.focal);
    m.field("principal_px", s.rig_error.principal_px);
    m.field("mass", s.rig_error.mass);
    m.field("com_mm", s.rig_error.com_mm);
    m.field("thrust", s.rig_error.thrust);
  });
  v.field("planner_delay_ms", s.planner_delay_ms);
  v.list("faults", s.faults, [](auto& m, FaultScenario& fault) {
    m.word("kind", fault.kind, kFaultKinds);
    m.field("at_s", fault.at_s);
    m.field("for_s", fault.for_s);
    for (const FaultParameter& p : fault_parameters(fault.kind)) {
      m.field(p.name, fault.*p.value);
    }
  });
}

class Reader {
 public:
  explicit Reader(YamlMap map) : map_(std::move(map)) {}

  template <class T>
  void field(const char* key, T& value) {
    map_.read(key, value);
  }
  template <class Enum>
  void choice(const char* key, Enum& value, std::initializer_list<Enum> all) {
    choose(key, value, std::vector<Enum>(all));
  }
  /// One of an enumeration's first `count`, which must be told.
  template <class Enum>
  void word(const char* key, Enum& value, int count) {
    map_.require(key);
    std::vector<Enum> all;
    for (int k = 0; k < count; ++k) all.push_back(static_cast<Enum>(k));
    choose(key, value, all);
  }
  template <class Fill>
  void map(const char* key, Fill&& fill) {
    Reader inner(map_.map(key));
    fill(inner);
  }
  template <class T, class Fill>
  void list(const char* key, std::vector<T>& items, Fill&& fill) {
    if (!map_.has(key)) return;
    items.clear();
    for (const YamlMap& entry : map_.list(key)) {
      Reader inner(entry);
      items.emplace_back();
      fill(inner, items.back());
    }
  }

 private:
  /// The first of `all` that the file names; else the nearest is told.
  template <class Enum>
  void choose(const char* key, Enum& value, const std::vector<Enum>& all) {
    std::string word = to_string(value);
    map_.read(key, word);
    std::vector<std::string> words;
    for (const Enum e : all) {
      if (word == to_string(e)) {
        value = e;
        return;
      }
      words.emplace_back(to_string(e));
    }
    map_.complain(key, not_one_of(word, words));
  }
  YamlMap map_;
};

/// As YAML reads it back, whatever is in it.
std::string double_quoted(const std::string& text) {
  std::string result(1, '"');
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result += '"';
}

class Writer {
 public:
  explicit Writer(std::ostringstream& out, std::string indent = {})
      : out_(out), indent_(std::move(indent)) {}

  void field(const char* key, const double& value) { line(key, number_text(value)); }
  void field(const char* key, const std::string& value) {
    line(key, double_quoted(value));
  }
  void field(const char* key, const int& value) { line(key, std::to_string(value)); }
  void field(const char* key, const bool& value) {
    line(key, value ? "true" : "false");
  }
  template <class Enum>
  void choice(const char* key, Enum& value, std::initializer_list<Enum>) {
    line(key, to_string(value));
  }
  template <class Enum>
  void word(const char* key, Enum& value, int) {
    line(key, to_string(value));
  }
  template <class Fill>
  void map(const char* key, Fill&& fill) {
    out_ << indent_ << key << ":\n";
    Writer inner(out_, indent_ + "  ");
    fill(inner);
  }
  template <class T, class Fill>
  void list(const char* key, std::vector<T>& items, Fill&& fill) {
    out_ << indent_ << key << ":" << (items.empty() ? " []" : "") << "\n";
    for (T& item : items) {
      out_ << indent_ << "  -\n";
      Writer inner(out_, indent_ + "    ");
      fill(inner, item);
    }
  }

 private:
  void line(const char* key, const std::string& value) {
    out_ << indent_ << key << ": " << value << "\n";
  }
  std::ostringstream& out_;
  std::string indent_;
};

/// The drive stands beside the scenario, unless its path is absolute.
Result<void> read_drive(PlatformScenario& platform, const std::string& place,
                        const std::string& name) {
  const auto path = std::filesystem::path(name).parent_path() / platform.file;
  auto text = read_file(path.string());
  if (!text) return fail(text.error().fault, place + ": " + text.error().detail);
  auto drive = parse_drive(path.string(), *text);
  if (!drive) return fail(drive.error());
  if (auto good = RecordedDrive::create(*drive); !good) {
    return fail(good.error().fault, path.string() + ": " + good.error().detail);
  }
  std::error_code code;
  const auto absolute = std::filesystem::absolute(path, code).lexically_normal();
  platform.file = code ? path.string() : absolute.string();
  platform.file_text = std::move(*text);
  platform.drive = std::move(*drive);
  return {};
}

Result<Scenario> read(Result<YamlMap> file, const std::string& name) {
  if (!file) return fail(file.error());
  Scenario scenario;
  Reader reader(*file);
  visit(reader, scenario);
  if (auto good = file->finish(); !good) return fail(good.error());
  PlatformScenario& platform = scenario.platform;
  if (platform.kind == PlatformKind::recorded && !platform.file.empty()) {
    const std::string place = file->map("platform").place("file");
    if (auto good = read_drive(platform, place, name); !good) {
      return fail(good.error());
    }
  }
  if (auto good = scenario.validate(); !good) {
    return fail(good.error().fault, name + ": " + good.error().detail);
  }
  return scenario;
}

}  // namespace

Result<Scenario> load_scenario(const std::string& path) {
  return read(YamlMap::load(path), path);
}

Result<Scenario> parse_scenario(const std::string& text, const std::string& name) {
  return read(YamlMap::parse(text, name), name);
}

std::string scenario_text(const Scenario& scenario) {
  std::ostringstream out;
  Scenario copy = scenario;
  Writer writer(out);
  visit(writer, copy);
  return out.str();
}

}  // namespace alight
