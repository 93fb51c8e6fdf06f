#include "alight/run/reproduce.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <nlohmann/json.hpp>

#include "alight/eval/statistics.h"
#include "alight/io/plot.h"
#include "alight/run/landing_run.h"
#include "alight/sim/true_rig.h"

namespace alight {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kTrackedM = 0.15;  // CONTRACT: tracked
constexpr double kTrackedRad = 15 * kDegree;
constexpr double kParkedS = 1.0;  // stands still at least so long in every row
constexpr double kHoldAtS = 4;    // rows that follow: no landing is begun,
constexpr double kHoldEndS = 20;  // and it ends here

/// Processor time of all threads: what a method costs, however busy the machine is.
double cpu_us() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e6 * static_cast<double>(now.tv_sec) +
         1e-3 * static_cast<double>(now.tv_nsec);
}

/// The errors of one method.
class Scorer {
 public:
  explicit Scorer(std::string method) { score_.method = std::move(method); }

  void add(const FrameReport& report, const TruthState& truth, bool scored, double us) {
    us_.push_back(us);
    if (!scored) return;
    ++score_.frames;
    if (!report.tracked) return;
    ++score_.returned;
    const double p = (report.x.p_NB - truth.X_NB.translation()).norm();
    const double R = angle_between(report.x.R_NB, truth.X_NB.linear());
    if (p < kTrackedM && R < kTrackedRad) {
      ++score_.correct;
      position_correct_ += p * p;
      rotation_correct_ += R * R;
    }
    position_ += p * p;
    rotation_ += R * R;
    velocity_ += (report.x.v_NB - truth.v_NB).squaredNorm();
    score_.estimate.emplace_back(report.t, report.x.X_NB());
  }

  MethodScore score() const {
    MethodScore s = score_;
    const auto root = [](double sum, int count) {
      return count > 0 ? std::sqrt(sum / count) : kNaN;
    };
    s.position_rmse_m = root(position_, s.returned);
    s.rotation_rmse_deg = root(rotation_, s.returned) / kDegree;
    s.velocity_rmse_m_s = root(velocity_, s.returned);
    s.position_correct_rmse_m = root(position_correct_, s.correct);
    s.rotation_correct_rmse_deg = root(rotation_correct_, s.correct) / kDegree;
    s.us_p50 = percentile(us_, 0.5);
    s.us_p99 = percentile(us_, 0.99);
    return s;
  }

 private:
  MethodScore score_;
  double position_ = 0, rotation_ = 0, velocity_ = 0;
  double position_correct_ = 0, rotation_correct_ = 0;
  std::vector<double> us_;
};

/// A method on the pictures, with its errors.
struct Runner {
  FrameTracker tracker;
  bool depth;
  Scorer scorer;
  FrameReport report;
  double us = 0;

  void fuse(const CameraFrame& frame) {
    CameraFrame seen = frame;
    if (!depth) seen.depth = {};
    const double begin = cpu_us();
    tracker.fuse(seen, report);
    us = cpu_us() - begin;
  }
  void score(const TruthState& truth, bool scored) {
    scorer.add(report, truth, scored, us);
  }
};

Result<std::vector<Runner>> make_runners(const ReproduceOptions& options) {
  struct Kind {
    const char* name;
    FrameTrackerOptions tracker;
    bool depth;
  };
  std::vector<Kind> kinds = {
      {"parked", {.parked_s = kParkedS}, true},
      {"default", {}, false},
      {"paper", {.profile = Profile::paper}, true},
      {"kf-less", {.method = TrackMethod::kf_less}, true},
  };
  const bool table_two =
      options.row == PaperRow::circle || options.row == PaperRow::landing;
  if (options.tags && table_two) {
    kinds.push_back({"aruco", {.method = TrackMethod::aruco}, false});
  }
  std::vector<Runner> runners;
  for (const Kind& kind : kinds) {
    auto tracker = FrameTracker::create(kind.tracker, options.rig);
    if (!tracker) return fail(tracker.error());
    runners.push_back({std::move(*tracker), kind.depth, Scorer(kind.name), {}, 0});
  }
  return runners;
}

/// What every sequence gathers.
class Gatherer {
 public:
  Gatherer(const Rig& rig, std::vector<Runner> runners)
      : p_NC_(rig.camera.X_NC.translation()), runners_(std::move(runners)) {}

  void see(const CameraFrame& frame) {
    for (Runner& runner : runners_) runner.fuse(frame);
  }
  void judge(const TruthState& truth, bool scored) {
    for (Runner& runner : runners_) runner.score(truth, scored);
    if (!scored) return;
    const double range = (truth.X_NB.translation() - p_NC_).norm();
    result.range_min_m =
        result.truth.empty() ? range : std::min(result.range_min_m, range);
    result.range_max_m = std::max(result.range_max_m, range);
    result.speed_max_m_s = std::max(result.speed_max_m_s, truth.v_NB.norm());
    result.truth.emplace_back(truth.t, truth.X_NB);
  }
  void finish() {
    for (const Runner& runner : runners_)
      result.methods.push_back(runner.scorer.score());
    if (!result.truth.empty()) {
      result.seconds =
          to_seconds(result.truth.back().first - result.truth.front().first);
    }
  }

  ReproduceResult result;

 private:
  Vector3 p_NC_;
  std::vector<Runner> runners_;
};

/// The rig errors that Alight's scenarios have.
RigErrorScenario rig_errors() { return {}; }

class LandingObserver final : public RunObserver {
 public:
  LandingObserver(PaperRow row, Gatherer& gatherer, Scorer& loop)
      : row_(row), gatherer_(gatherer), loop_(loop) {}

  void on_world(const World& world) override { world_ = &world; }
  void on_picture(const CameraFrame& frame) override {
    if (frame.captured > last_) gatherer_.see(frame);
    last_ = frame.captured;
  }
  void on_frame(const FrameReport& frame, const TruthState& truth, double us) override {
    if (truth.t != last_) return;
    const bool landing = state_ == MissionState::rendezvous ||
                         state_ == MissionState::land ||
                         state_ == MissionState::go_around;
    const bool following =
        state_ == MissionState::follow || state_ == MissionState::hold;
    const bool scored = !world_->contact().touched_down &&
                        (row_ == PaperRow::landing ? landing : following);
    gatherer_.judge(truth, scored);
    loop_.add(frame, truth, scored, us);
  }
  void on_step(const Output& output, const TruthState&, double) override {
    state_ = output.mission.state;
  }

 private:
  PaperRow row_;
  Gatherer& gatherer_;
  Scorer& loop_;
  const World* world_ = nullptr;
  MissionState state_ = MissionState::idle;
  Time last_ = -1;
};

Result<void> fly(const ReproduceOptions& options, Gatherer& gatherer) {
  LandingRunOptions run;
  run.rig = options.rig;
  run.seed = options.seed;
  run.scenario.wind = {.mean_m_s = 2, .from_deg = 0, .gusts = Gusts::dryden};
  run.scenario.rig_error = rig_errors();
  PlatformScenario& platform = run.scenario.platform;
  if (options.row == PaperRow::dynamic_block) {
    platform.kind = PlatformKind::block;
    platform.speed_m_s = 0.5;
    platform.side_m = 4;
  } else {
    platform.kind = PlatformKind::circle;
    platform.speed_m_s = 0.9;
    platform.radius_m = 1.5;
  }
  if (options.row != PaperRow::landing) {
    run.hold_at_s = kHoldAtS;
    run.timeout_s = kHoldEndS;
  }
  Scorer loop("loop");
  LandingObserver observer(options.row, gatherer, loop);
  const auto landed = run_landing(run, &observer);
  if (!landed) return fail(landed.error());
  gatherer.result.outcome = to_string(landed->outcome);
  gatherer.result.methods.push_back(loop.score());
  return {};
}

Result<void> follow_script(const ReproduceOptions& options, Gatherer& gatherer) {
  const Rng rng(options.seed);
  const TrueRig truth = draw_true_rig(options.rig, rig_errors(), rng.fork("rig"));
  const ScriptedFlight flight(options.row, truth.rig, truth.extras.R_FB,
                              rng.fork(to_string(options.row)));
  CameraSimConfig camera;
  camera.led_axis_B = leds_face(options.rig);
  camera.depth_offset_ms = 15 * rng.fork("depth offset").uniform(-1, 1);
  auto renderer = CameraRenderer::create(camera, truth.rig, options.seed);
  if (!renderer) return fail(renderer.error());
  ColorBuffer color;
  DepthBuffer depth;
  const double half = 0.5 * span_of(options.rig.timing);
  for (std::uint64_t k = 0;; ++k) {
    const double t = (static_cast<double>(k) + 0.5) / options.rig.timing.rate_hz;
    if (t > ScriptedFlight::kEnd) return {};
    const SceneAt exposure[3] = {flight.at(t - half), flight.at(t),
                                 flight.at(t + half)};
    const SceneAt depth_scene = flight.at(t + 1e-3 * camera.depth_offset_ms);
    if (auto good = renderer->render(k, exposure, color, &depth, &depth_scene); !good) {
      return fail(good.error());
    }
    CameraFrame frame;
    frame.captured = frame.received = from_seconds(t);
    frame.color = color.view();
    frame.depth = depth.view();
    gatherer.see(frame);
    TruthState now;
    now.t = frame.captured;
    now.X_NB = exposure[1].X_NB;
    constexpr double kStep = 1e-3;
    now.v_NB = (flight.at(t + kStep).X_NB.translation() -
                flight.at(t - kStep).X_NB.translation()) /
               (2 * kStep);
    gatherer.judge(now, t >= ScriptedFlight::kOnPath);
  }
}

nlohmann::ordered_json number_or_null(double value) {
  if (std::isfinite(value)) return value;
  return nullptr;
}

Rgb color_of(const std::string& method) {
  if (method == "loop" || method == "parked") return palette::blue;
  if (method == "default") return palette::sky;
  if (method == "paper") return palette::orange;
  if (method == "kf-less") return palette::purple;
  return palette::green;
}

}  // namespace

Result<ReproduceResult> reproduce(const ReproduceOptions& options) {
  auto runners = make_runners(options);
  if (!runners) return fail(runners.error());
  Gatherer gatherer(options.rig, std::move(*runners));
  const auto done =
      is_flown(options.row) ? fly(options, gatherer) : follow_script(options, gatherer);
  if (!done) return fail(done.error());
  gatherer.finish();
  return std::move(gatherer.result);
}

std::string reproduce_json(const ReproduceOptions& options,
                           const ReproduceResult& result) {
  nlohmann::ordered_json json{{"row", to_string(options.row)},
                              {"seed", options.seed},
                              {"outcome", result.outcome},
                              {"seconds", result.seconds},
                              {"range_m", {result.range_min_m, result.range_max_m}},
                              {"speed_max_m_s", result.speed_max_m_s}};
  for (const MethodScore& s : result.methods) {
    json["methods"][s.method] = {
        {"frames", s.frames},
        {"returned", s.returned},
        {"correct", s.correct},
        {"position_rmse_m", number_or_null(s.position_rmse_m)},
        {"rotation_rmse_deg", number_or_null(s.rotation_rmse_deg)},
        {"velocity_rmse_m_s", number_or_null(s.velocity_rmse_m_s)},
        {"position_correct_rmse_m", number_or_null(s.position_correct_rmse_m)},
        {"rotation_correct_rmse_deg", number_or_null(s.rotation_correct_rmse_deg)},
        {"us", {{"p50", s.us_p50}, {"p99", s.us_p99}}}};
  }
  return json.dump(2) + "\n";
}

Result<void> save_reproduce_figure(const std::string& path,
                                   const ReproduceOptions& options,
                                   const ReproduceResult& result) {
  Panel above{.title = std::string(to_string(options.row)) + ": from above, in N",
              .x_label = "x, m",
              .y_label = "y, m",
              .equal_aspect = true};
  Panel side{.title = "from the side",
             .x_label = "x, m",
             .y_label = "z, m",
             .equal_aspect = true};
  Panel position{.title = "error of the position",
                 .x_label = "t, s",
                 .y_label = "m",
                 .y_from_zero = true};
  Panel rotation{.title = "error of the rotation",
                 .x_label = "t, s",
                 .y_label = "deg",
                 .y_from_zero = true};
  const auto draw = [&](const PoseLog& log, const std::string& label, Rgb color,
                        Mark mark) {
    Series xy{.label = label, .color = color, .mark = mark};
    Series xz = xy;
    for (const auto& [t, X] : log) {
      xy.x.push_back(X.translation().x());
      xy.y.push_back(X.translation().y());
      xz.x.push_back(X.translation().x());
      xz.y.push_back(X.translation().z());
    }
    xz.label.clear();
    above.series.push_back(std::move(xy));
    side.series.push_back(std::move(xz));
  };
  const Time start = result.truth.empty() ? 0 : result.truth.front().first;
  // The one that is looked at first is drawn last.
  for (auto method = result.methods.rbegin(); method != result.methods.rend();
       ++method) {
    if (method->method == "default") continue;
    const Rgb color = color_of(method->method);
    if (method->method == "parked" && !result.outcome.empty()) continue;
    draw(method->estimate, method->method, color, Mark::dots);
    above.series.back().width_px = side.series.back().width_px = 3;
    // Outliers would hide everything else.
    above.series.back().in_range = side.series.back().in_range = false;
    Series p{
        .label = method->method, .color = color, .mark = Mark::dots, .width_px = 3};
    Series R = p;
    R.label.clear();
    auto truth = result.truth.begin();
    for (const auto& [t, X] : method->estimate) {
      while (truth != result.truth.end() && truth->first < t) ++truth;
      if (truth == result.truth.end()) break;
      p.x.push_back(to_seconds(t - start));
      R.x.push_back(p.x.back());
      p.y.push_back((X.translation() - truth->second.translation()).norm());
      R.y.push_back(angle_between(X.linear(), truth->second.linear()) / kDegree);
    }
    const bool ours = method->method == "loop" || method->method == "parked" ||
                      method->method == "paper";
    p.in_range = R.in_range = ours;
    position.series.push_back(std::move(p));
    rotation.series.push_back(std::move(R));
  }
  draw(result.truth, "truth", palette::black, Mark::line);
  FigureOptions figure;
  figure.columns = 2;
  figure.panel_width_px = 640;
  figure.panel_height_px = 360;
  return save_figure(path, {above, side, position, rotation}, figure);
}

}  // namespace alight
