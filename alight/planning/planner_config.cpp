#include <cmath>
#include <sstream>

#include "alight/planning/planner.h"

namespace alight {
namespace {

struct Field {
  const char* name;
  double value;
  double low;
  double high;
};

}  // namespace

Result<void> PlannerConfig::validate() const {
  const Field fields[] = {
      {"touch_down_height_m", touch_down_height_m, 0.05, 10},
      {"dilation_m", dilation_m, 1e-3, 1},
      {"free_space_margin_m", free_space_margin_m, 0, 100},
      {"shrink_m", shrink_m, 0, 5},
      {"end_height_m", end_height_m, 0, 5},
      {"touch_down_speed_m_s", touch_down_speed_m_s, 0, 2},
      {"end_yaw", end_yaw, -kPi, kPi},
      {"view_border_px", view_border_px, 0, 200},
      {"view_wish_px", view_wish_px, 0, 200},
      {"escape_clearance_m", escape_clearance_m, 0, 1},
      {"attitude_spare_deg", attitude_spare_deg, 0, 30},
      {"tilt_max_deg", tilt_max_deg, 1, 60},
      {"thrust_least_share", thrust_least_share, 0, 0.95},
      {"thrust_most_share", thrust_most_share, 0.1, 1},
      {"body_rate_max_deg_s", body_rate_max_deg_s, 10, 2000},
      {"yaw_rate_max_deg_s", yaw_rate_max_deg_s, 10, 2000},
      {"funnel_radius_m", funnel_radius_m, 0.001, 10},
      {"funnel_slope_deg", funnel_slope_deg, 1, 89},
      {"time_samples", static_cast<double>(time_samples), 1, 200},
      {"slowest_m_s", slowest_m_s, 0.01, 10},
      {"shortest_s", shortest_s, 0.05, 10},
      {"tightening", tightening, 0.1, 1},
      {"time_weight", time_weight, 0, 1e6},
  };
  for (const Field& field : fields) {
    if (field.value >= field.low && field.value <= field.high) continue;
    std::ostringstream text;
    text << "planner." << field.name << " is " << field.value << ", must lie in ["
         << field.low << ", " << field.high << "]";
    return fail(Fault::invalid_config, text.str());
  }
  return {};
}

PlannerConfig PlannerConfig::paper() {
  PlannerConfig config;
  config.profile = Profile::paper;
  config.end_height_m = 0.14;
  config.touch_down_speed_m_s = 0;
  config.view_border_px = 0;
  config.view_wish_px = 0;
  config.time_weight = 0;
  return config;
}

}  // namespace alight
