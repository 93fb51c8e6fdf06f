#include "alight/run/flight_path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "alight/base/bounds.h"
#include "alight/sim/camera_config.h"

namespace alight {
namespace {

constexpr Seconds kStep = 1.0 / 60;    // between the instants that are checked
constexpr Seconds kStride = 0.05;      // while the pace is looked for
constexpr Seconds kDifference = 1e-3;  // for derivatives: the path is smooth
constexpr double kSlowestPart = 0.85;  // of the top speed
constexpr double kGround = 0.02;       // m, LEDs above the pad's plane
constexpr int kDraws = 4000;
constexpr int kHopeless = 1500;  // draws without a flight that does
constexpr int kPaceSteps = 8;

/// A smooth minimum, at most 0.7 / 40 below the true one.
double soft_min(double a, double b) {
  const double k = 40;
  const double low = std::min(a, b);
  return low - std::log(std::exp(-k * (a - low)) + std::exp(-k * (b - low))) / k;
}

/// Of any two LEDs in the picture; NaN when one is out of it.
double closest_images(const Rig& rig, const Pose& X_NB, double border_px) {
  FixedVector<Vector2, kMaxLeds> images;
  for (int i = 0; i < rig.leds.size(); ++i) {
    const auto uv = project_led(rig.camera, X_NB, rig.leds.p_BL(i));
    if (!uv || !rig.camera.intrinsics.contains(*uv, border_px)) {
      return std::numeric_limits<double>::quiet_NaN();
    }
    images.push_back(*uv);
  }
  double closest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < images.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      closest = std::min(closest, (images[i] - images[j]).norm());
    }
  }
  return closest;
}

bool above_ground(const Rig& rig, const Pose& X_NB) {
  for (int i = 0; i < rig.leds.size(); ++i) {
    if ((X_NB * rig.leds.p_BL(i)).z() < kGround) return false;
  }
  return true;
}

}  // namespace

Result<void> FlightPathConfig::validate() const {
  return check_bounds(
      {{"range_min_m", range_min_m, 0.2, 100},
       {"range_max_m", range_max_m, range_min_m + kRoom_m, kRangeMost_m},
       {"speed_m_s", speed_m_s, kSpeedLeast_m_s, kSpeedMost_m_s},
       {"heading_off_min_deg", heading_off_min_deg, 0, 80},
       {"heading_off_max_deg", heading_off_max_deg, heading_off_min_deg, 80},
       {"turn_rate_rad_s", turn_rate_rad_s, 0.1, 20},
       {"tilt_max_deg", tilt_max_deg, 1, 80},
       {"border_px", border_px, 0, 200},
       {"close_px", close_px, 0, 100},
       {"close_share", close_share, 0, 1}});
}

FlightPath::Wave::Wave(Rng rng, double pace, Seconds duration) {
  for (std::size_t k = 0; k < 3; ++k) {
    amplitude_[k] = rng.uniform(0.3, 1);
    rate_[k] = 2 * kPi * pace * rng.uniform(0.4, 1.6);
    phase_[k] = rng.uniform(0, 2 * kPi);
  }
  double low = sum(0), high = low;
  for (Seconds t = 0; t <= duration; t += kStride) {
    low = std::min(low, sum(t));
    high = std::max(high, sum(t));
  }
  middle_ = 0.5 * (low + high);
  scale_ = 2 / std::max(high - low, 1e-9);
}

double FlightPath::Wave::sum(Seconds t) const {
  double s = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    s += amplitude_[k] * std::sin(rate_[k] * t + phase_[k]);
  }
  return s;
}

FlightPath::FlightPath(const FlightPathConfig& config, const Rig& rig, Seconds duration,
                       double pace, const Rng& rng)
    : duration_(duration),
      X_NC_(rig.camera.X_NC),
      size_(0),
      height_(0),
      range_(rng.fork("range"), pace, duration),
      across_(rng.fork("across"), pace, duration),
      down_(rng.fork("down"), pace, duration),
      heading_(rng.fork("heading"), pace, duration) {
  Rng draw = rng.fork("amplitudes");
  const Vector3 front = leds_face(rig);
  front_ = std::atan2(front.y(), front.x());
  heading_off_ =
      draw.uniform(config.heading_off_min_deg, config.heading_off_max_deg) * kDegree;
  // Whole ranges are asked for; each flight comes near to both ends.
  const double room = 0.1 * (config.range_max_m - config.range_min_m);
  range_min_ = config.range_min_m + room * draw.uniform(0.02, 1);
  range_max_ = config.range_max_m - room * draw.uniform(0.02, 1);

  const Intrinsics& lens = rig.camera.intrinsics;
  const double u = 0.5 * lens.width, v = 0.5 * lens.height;
  const double border = config.border_px + 4;
  edge_[0] = lens.unproject({border, v}).x();
  edge_[1] = lens.unproject({lens.width - 1 - border, v}).x();
  edge_[2] = lens.unproject({u, border}).y();
  edge_[3] = lens.unproject({u, lens.height - 1 - border}).y();
  for (int i = 0; i < rig.leds.size(); ++i) {
    size_ = std::max(size_, rig.leds.p_BL(i).norm());
  }
  height_ = kGround + size_ + 0.02;
}

Vector3 FlightPath::position(Seconds t) const {
  const double range = range_min_ + (range_max_ - range_min_) * 0.5 * (1 + range_(t));
  const double margin = size_ / (0.8 * range);  // of an LED off the centre of B
  const auto between = [](double low, double high, double share) {
    return 0.5 * (low + high) + 0.5 * (high - low) * share;
  };
  const double x = between(edge_[0] + margin, edge_[1] - margin, across_(t));
  double lowest = edge_[3] - margin;
  const Vector3 up_C = X_NC_.linear().row(2);
  if (up_C.y() < -0.2) {
    const double rise = height_ - X_NC_.translation().z();
    lowest = soft_min(lowest, (rise / (0.85 * range) - up_C.z()) / up_C.y());
  }
  const double y = between(edge_[2] + margin, lowest, down_(t));
  return X_NC_ * (range * Vector3(x, y, 1).normalized());
}

Vector3 FlightPath::velocity(Seconds t) const {
  return (position(t + kDifference) - position(t - kDifference)) / (2 * kDifference);
}

Matrix3 FlightPath::attitude(Seconds t) const {
  const Vector3 p = position(t);
  const Vector3 a = (position(t + kDifference) - 2 * p + position(t - kDifference)) /
                    (kDifference * kDifference);
  const Vector3 z = (a + Vector3(0, 0, kGravity)).normalized();
  const Vector3 to_lens = X_NC_.translation() - p;
  const double yaw =
      std::atan2(to_lens.y(), to_lens.x()) - front_ + heading_off_ * heading_(t);
  const Vector3 y = z.cross(Vector3(std::cos(yaw), std::sin(yaw), 0)).normalized();
  Matrix3 R_NB;
  R_NB << y.cross(z), y, z;
  return R_NB;
}

RelativeState FlightPath::at(Seconds t) const {
  return {position(t), attitude(t), velocity(t)};
}

double FlightPath::top_speed() const {
  double top = 0;
  for (Seconds t = 0; t <= duration_; t += kStride) {
    top = std::max(top, velocity(t).norm());
  }
  return top;
}

bool FlightPath::holds(const FlightPathConfig& config, const Rig& rig) {
  int instants = 0, close = 0;
  const double upright = std::cos(config.tilt_max_deg * kDegree);
  Matrix3 before = attitude(-kStep);
  for (Seconds t = 0; t <= duration_; t += kStep) {
    const RelativeState x = at(t);
    const Vector3 to_lens = X_NC_.translation() - x.p_NB;
    if (to_lens.norm() < config.range_min_m || to_lens.norm() > config.range_max_m ||
        x.v_NB.norm() > config.speed_m_s || x.R_NB(2, 2) < upright ||
        !above_ground(rig, x.X_NB()) ||
        angle_between(before, x.R_NB) > config.turn_rate_rad_s * kStep) {
      return false;
    }
    before = x.R_NB;
    const double apart = closest_images(rig, x.X_NB(), config.border_px);
    if (std::isnan(apart)) return false;
    ++instants;
    if (apart < config.close_px) ++close;
  }
  close_share_ = static_cast<double>(close) / instants;
  return true;
}

Result<FlightPath> FlightPath::draw(const FlightPathConfig& config, const Rig& rig,
                                    Seconds duration, Rng rng) {
  if (auto good = config.validate(); !good) return fail(good.error());
  std::optional<FlightPath> best;
  for (int k = 0; k < kDraws; ++k) {
    Rng draw = rng.fork("path " + std::to_string(k));
    const double wanted = config.speed_m_s * draw.uniform(kSlowestPart, 1);
    double pace = 0.15;
    for (int step = 0; step < kPaceSteps; ++step) {
      FlightPath path(config, rig, duration, pace, draw);
      const double speed = path.top_speed();
      if (speed <= config.speed_m_s && speed >= kSlowestPart * config.speed_m_s) {
        if (path.holds(config, rig) &&
            (!best || path.close_share_ > best->close_share_)) {
          best = path;
        }
        break;
      }
      pace *= wanted / speed;
    }
    if (best ? best->close_share_ >= config.close_share || k > kDraws / 4
             : k > kHopeless) {
      break;
    }
  }
  if (best) return *best;
  return fail(Fault::infeasible,
              "the camera of the rig has no room for such a flight: all LEDs in view "
              "and above the pad at every range");
}

}  // namespace alight
