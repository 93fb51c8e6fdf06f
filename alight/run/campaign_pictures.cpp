#include "alight/run/campaign_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>

#include "alight/io/files.h"
#include "alight/io/plot.h"
#include "alight/run/fault_grid.h"

namespace alight {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::array<Rgb, 7> kColors{palette::blue,   palette::orange, palette::green,
                                     palette::purple, palette::sky,    palette::amber,
                                     palette::black};

template <class Figure>
Panel spread_panel(const char* title, const char* unit, const CampaignOptions& options,
                   const CampaignResult& result, Figure&& figure) {
  Panel panel;
  panel.title = title;
  panel.x_label = unit;
  panel.y_label = "share of the landings up to it";
  panel.y_from_zero = true;
  for (std::size_t s = 0; s < options.scenarios.size(); ++s) {
    Series line;
    line.label = std::filesystem::path(options.scenarios[s].name).stem().string();
    line.color = kColors[s % kColors.size()];
    std::vector<double> values;
    for (const CampaignRun& run : result.runs) {
      if (run.scenario != s) continue;
      const double value = figure(run.result);
      if (std::isfinite(value)) values.push_back(value);
    }
    std::sort(values.begin(), values.end());
    for (std::size_t i = 0; i < values.size(); ++i) {
      line.x.push_back(values[i]);
      line.y.push_back(static_cast<double>(i + 1) / static_cast<double>(values.size()));
    }
    panel.series.push_back(std::move(line));
  }
  return panel;
}

std::vector<Panel> spread_panels(const CampaignOptions& options,
                                 const CampaignResult& result) {
  using R = LandingResult;
  return {spread_panel("Error at touch-down", "cm", options, result,
                       [](const R& r) {
                         return r.touchdown ? 100 * r.touchdown->error_m : kNaN;
                       }),
          spread_panel("Relative speed at touch-down", "m/s", options, result,
                       [](const R& r) {
                         return r.touchdown ? r.touchdown->relative_speed_m_s : kNaN;
                       }),
          spread_panel(
              "Tilt at touch-down", "deg", options, result,
              [](const R& r) { return r.touchdown ? r.touchdown->tilt_deg : kNaN; }),
          spread_panel("Tracking", "RMSE, m", options, result,
                       [](const R& r) { return r.tracking_rmse_m; })};
}

/// A row a fault, from above in the order of the grid; a column an instant.
Panel fault_panel(const CampaignOptions& options, const CampaignResult& result) {
  struct Cell {
    int runs = 0, landed = 0, wrong = 0;
  };
  std::map<std::string, int> rows;
  std::vector<std::string> names;
  std::map<std::pair<int, double>, Cell> cells;
  double first = 1e9, last = 0;
  for (const CampaignRun& run : result.runs) {
    const CampaignScenario& scenario = options.scenarios[run.scenario];
    const auto [row, fresh] =
        rows.try_emplace(scenario.fault, static_cast<int>(names.size()));
    if (fresh) names.push_back(scenario.fault);
    const double at_s = scenario.scenario.faults.front().at_s;
    first = std::min(first, at_s);
    last = std::max(last, at_s);
    Cell& cell = cells[{row->second, at_s}];
    ++cell.runs;
    cell.landed += run.result.outcome == Outcome::landed;
    cell.wrong += !ended_well(scenario, run.result);
  }
  Panel panel;
  panel.title = "How landings ended, by fault and the instant of its beginning";
  panel.x_label = "s from the start";
  panel.y_label = "";
  const auto dots = [](const char* label, Rgb color) {
    return Series{.label = label, .color = color, .mark = Mark::dots, .width_px = 9};
  };
  std::array<Series, 3> marks{dots("all landed", palette::green),
                              dots("some otherwise, rightly", palette::amber),
                              dots("some wrongly", palette::orange)};
  for (const auto& [place, cell] : cells) {
    Series& mark = marks[cell.wrong > 0 ? 2 : cell.landed < cell.runs ? 1 : 0];
    mark.x.push_back(place.second);
    mark.y.push_back(-place.first);
  }
  panel.series.assign(marks.begin(), marks.end());
  for (std::size_t i = 0; i < names.size(); ++i) {
    panel.notes.push_back({last + 0.05 * (last - first + 1), -static_cast<double>(i),
                           names[i], palette::black});
  }
  // Room for the names.
  panel.series.push_back({.x = {first, last + 0.8 * (last - first + 1)},
                          .y = {1, 1},
                          .color = palette::white,
                          .width_px = 1});
  return panel;
}

}  // namespace

Result<std::vector<std::string>> save_campaign_pictures(const std::string& folder,
                                                        const CampaignOptions& options,
                                                        const CampaignResult& result) {
  if (auto good = make_folder(folder); !good) return fail(good.error());
  const bool of_faults = !options.scenarios.front().fault.empty();
  const std::string name = folder + (of_faults ? "/faults.png" : "/touchdown.png");
  std::vector<Panel> panels;
  FigureOptions figure;
  if (of_faults) {
    panels = {fault_panel(options, result)};
    const auto rows = static_cast<int>(summarize_faults(options, result).size());
    figure.panel_width_px = 1200;
    figure.panel_height_px = std::clamp(22 * rows + 120, 300, 8000);
  } else {
    panels = spread_panels(options, result);
    figure.columns = 2;
    figure.panel_width_px = 700;
  }
  if (auto good = save_figure(name, panels, figure); !good) return fail(good.error());
  return std::vector<std::string>{name};
}

}  // namespace alight
