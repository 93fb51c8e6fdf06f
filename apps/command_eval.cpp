#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>

#include "alight/eval/path_error.h"
#include "alight/eval/statistics.h"
#include "alight/io/files.h"
#include "alight/io/json_text.h"
#include "alight/io/plot.h"
#include "alight/io/pose_log.h"
#include "checks.h"
#include "command.h"
#include "json.h"

using namespace alight;

namespace {

struct Options {
  std::string estimate;
  std::string truth;
  std::string align = "none";
  double max_dt_s = 0.02;
  bool max_dt_given = false;
  std::string out;
  bool json = false;
};

struct Evaluation {
  PosePairs pairs;  ///< aligned, if so wished
  PathError error;
  std::size_t estimates = 0;
  std::size_t truths = 0;
  std::vector<double> frame_ms;
};

Result<Evaluation> evaluate(const Options& options) {
  const auto estimate = load_pose_log(options.estimate);
  if (!estimate) return fail(estimate.error());
  const auto truth = load_pose_log(options.truth);
  if (!truth) return fail(truth.error());

  Evaluation result;
  result.estimates = estimate->poses.size();
  result.truths = truth->poses.size();
  result.frame_ms = estimate->frame_ms;
  const bool by_row =
      estimate->rows_match && truth->rows_match && !options.max_dt_given;
  if (by_row) {
    auto pairs = associate_rows(estimate->poses, truth->poses);
    if (!pairs)
      return fail(pairs.error().fault, options.estimate + ", " + options.truth + ": " +
                                           pairs.error().detail);
    result.pairs = std::move(*pairs);
  } else {
    result.pairs = associate(estimate->poses, truth->poses, options.max_dt_s);
  }
  if (result.pairs.empty()) {
    return fail(Fault::too_few_points,
                options.estimate + ": no pose has a true one in " + options.truth +
                    " within " + std::to_string(options.max_dt_s) +
                    " s; are both on one clock? (--max-dt)");
  }
  if (options.align == "se3") {
    const auto X = fit_se3(result.pairs);
    if (!X) return fail(X.error().fault, options.estimate + ": " + X.error().detail);
    result.pairs = moved(result.pairs, *X);
  }
  const auto error = path_error(result.pairs);
  if (!error) return fail(error.error());
  result.error = *error;
  return result;
}

Json as_json(const Options& options, const Evaluation& e) {
  Json json;
  json["estimate"] = options.estimate;
  json["truth"] = options.truth;
  json["align"] = options.align;
  json["estimates"] = e.estimates;
  json["truths"] = e.truths;
  json["pairs"] = e.error.count;
  json["ate_position_m"] = e.error.position_rmse_m;
  json["ate_rotation_deg"] = e.error.rotation_rmse_rad / kDegree;
  json["position_rmse_m"] = e.error.position_rmse_m;
  json["position_fitted_rmse_m"] = number_or_null(e.error.position_fitted_rmse_m);
  json["position_p95_m"] = e.error.position_p95_m;
  json["position_max_m"] = e.error.position_max_m;
  json["rotation_rmse_deg"] = e.error.rotation_rmse_rad / kDegree;
  json["rotation_mean_out_rmse_deg"] =
      number_or_null(e.error.rotation_mean_out_rmse_rad / kDegree);
  json["rotation_max_deg"] = e.error.rotation_max_rad / kDegree;
  json["success"] = e.error.success;
  if (!e.frame_ms.empty()) {
    json["frame_ms_median"] = percentile(e.frame_ms, 0.5);
    json["frame_ms_p99"] = percentile(e.frame_ms, 0.99);
  }
  return json;
}

void print_table(const Options& options, const Evaluation& e) {
  const auto line = [](const char* name, double value, const char* format) {
    char text[64];
    if (std::isfinite(value)) {
      std::snprintf(text, sizeof text, format, value);
    } else {
      std::snprintf(text, sizeof text, "not defined");
    }
    char row[160];
    std::snprintf(row, sizeof row, "  %-38s %s\n", name, text);
    std::cout << row;
  };
  std::cout << options.estimate << " against " << options.truth << ": " << e.error.count
            << " of " << e.estimates << " poses"
            << (options.align == "se3" ? ", fitted by a rigid motion" : "") << '\n';
  line("position, ATE (rmse)", e.error.position_rmse_m, "%.4f m");
  line("position, after a rigid fit", e.error.position_fitted_rmse_m, "%.4f m");
  line("position, 95 % within", e.error.position_p95_m, "%.4f m");
  line("position, largest", e.error.position_max_m, "%.4f m");
  line("rotation, ATE (rmse)", e.error.rotation_rmse_rad / kDegree, "%.2f deg");
  line("rotation, mean taken out", e.error.rotation_mean_out_rmse_rad / kDegree,
       "%.2f deg");
  line("rotation, largest", e.error.rotation_max_rad / kDegree, "%.2f deg");
  line("success (within 0.15 m and 15 deg)", 100 * e.error.success, "%.2f %%");
  if (e.frame_ms.empty()) return;
  line("time a frame, median", percentile(e.frame_ms, 0.5), "%.1f ms");
  line("time a frame, p99", percentile(e.frame_ms, 0.99), "%.1f ms");
}

std::vector<Panel> figures(const PosePairs& pairs) {
  const Time start = pairs.front().t;
  Series truth_top{.label = "truth", .color = palette::black};
  Series estimate_top{.label = "estimate", .color = palette::orange, .width_px = 1.5};
  Series position{.color = palette::blue};
  Series rotation{.color = palette::purple};
  Panel top{.title = "Path from above",
            .x_label = "x, m",
            .y_label = "y, m",
            .equal_aspect = true};
  Panel height{.title = "Height", .x_label = "t, s", .y_label = "z, m"};
  Series truth_z{.label = "truth", .color = palette::black};
  Series estimate_z{.label = "estimate", .color = palette::orange, .width_px = 1.5};
  for (const PosePair& pair : pairs) {
    const double t = to_seconds(pair.t - start);
    const Vector3 a = pair.truth.translation();
    const Vector3 b = pair.estimate.translation();
    truth_top.x.push_back(a.x());
    truth_top.y.push_back(a.y());
    estimate_top.x.push_back(b.x());
    estimate_top.y.push_back(b.y());
    for (Series* series : {&truth_z, &estimate_z, &position, &rotation}) {
      series->x.push_back(t);
    }
    truth_z.y.push_back(a.z());
    estimate_z.y.push_back(b.z());
    position.y.push_back((a - b).norm());
    rotation.y.push_back(angle_between(pair.truth.linear(), pair.estimate.linear()) /
                         kDegree);
  }
  top.series = {truth_top, estimate_top};
  height.series = {truth_z, estimate_z};
  return {top, height,
          Panel{.title = "Position error",
                .x_label = "t, s",
                .y_label = "m",
                .series = {position},
                .y_from_zero = true},
          Panel{.title = "Rotation error",
                .x_label = "t, s",
                .y_label = "deg",
                .series = {rotation},
                .y_from_zero = true}};
}

Result<void> run(const Options& options) {
  if (!options.out.empty()) {
    if (auto good = check_folder(options.out); !good) return good;
  }
  const auto evaluation = evaluate(options);
  if (!evaluation) return fail(evaluation.error());
  const std::string json = json_text(as_json(options, *evaluation), 2) + "\n";
  if (!options.out.empty()) {
    if (auto good = write_file(options.out + "/eval.json", json); !good) return good;
    const FigureOptions two{
        .columns = 2, .panel_width_px = 640, .panel_height_px = 400};
    if (auto good =
            save_figure(options.out + "/eval.png", figures(evaluation->pairs), two);
        !good) {
      return good;
    }
  }
  if (options.json) {
    std::cout << json;
  } else {
    print_table(options, *evaluation);
    if (!options.out.empty()) std::cout << "plots in " << options.out << "/eval.png\n";
  }
  return {};
}

}  // namespace

void add_eval(CLI::App& app, Job& job) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "eval",
      "Compares estimated poses with true ones: TUM files, the authors' CSV logs");
  command->add_option("ESTIMATE", options->estimate)->required();
  command->add_option("TRUTH", options->truth)->required();
  command
      ->add_option("--align", options->align,
                   "First bring the paths together: none, or a rigid motion (se3)")
      ->check(CLI::IsMember({"none", "se3"}))
      ->capture_default_str();
  auto* max_dt = command
                     ->add_option("--max-dt", options->max_dt_s,
                                  "Pair poses by time, at most this many seconds apart "
                                  "(CSV logs: row by row unless given)")
                     ->check(within(0, 1e6))
                     ->capture_default_str();
  command->add_option("--out", options->out, "Folder for eval.json and plots")
      ->check(named());
  command->add_flag("--json", options->json, "One JSON document instead of the table");
  command->callback([options, max_dt, &job] {
    options->max_dt_given = max_dt->count() > 0;
    job = [options] { return run(*options); };
  });
}
