#include "alight/calibration/constellation.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "alight/vision/pose_from_leds.h"

namespace alight {
namespace {

using Frames = std::vector<ObservedFrame>;

// A slip of unit or of LED is more than this share of a distance.
constexpr double kDistanceOff = 0.25;
constexpr double kFitsPx = 1.5;  // rms, of a pose that may be used

Frames usable(std::span<const ObservedFrame> frames, bool use_merged) {
  Frames out;
  for (ObservedFrame frame : frames) {
    for (std::size_t k = frame.seen.size(); k-- > 0;) {
      if (!use_merged && !std::has_single_bit(frame.seen[k].leds)) frame.seen.erase(k);
    }
    if (frame.seen.size() >= 4) out.push_back(frame);
  }
  return out;
}

/// rms distance of the images over the frames, poses fitted to each.
double rms_of(const Camera& camera, const Constellation& leds, const Frames& frames) {
  double sum = 0;
  double count = 0;
  for (const ObservedFrame& frame : frames) {
    const auto fit =
        refine_pose(camera, leds, {frame.seen.data(), frame.seen.size()}, frame.X_NB);
    if (!fit) continue;
    const auto n = static_cast<double>(frame.seen.size());
    sum += n * fit->rms_px * fit->rms_px;
    count += n;
  }
  return std::sqrt(sum / count);
}

std::vector<int> seen_alone(const Constellation& leds,
                            std::span<const ObservedFrame> frames) {
  std::vector<int> alone(static_cast<std::size_t>(leds.size()), 0);
  for (const ObservedFrame& frame : frames) {
    for (const LedObservation& o : frame.seen) {
      if (!std::has_single_bit(o.leds)) continue;
      ++alone[static_cast<std::size_t>(std::countr_zero(o.leds))];
    }
  }
  return alone;
}

std::string neighbours(int led, std::span<const ObservedFrame> frames) {
  unsigned with = 0;
  for (const ObservedFrame& frame : frames) {
    for (const LedObservation& o : frame.seen) {
      if (((o.leds >> led) & 1) != 0) with |= o.leds;
    }
  }
  std::string text;
  for (int i = 0; i < kMaxLeds; ++i) {
    if (i == led || ((with >> i) & 1) == 0) continue;
    text += (text.empty() ? "" : ", ") + std::to_string(i);
  }
  return text;
}

Result<void> enough(const ConstellationConfig& config, const Constellation& leds,
                    const Frames& frames, std::span<const ObservedFrame> all) {
  if (static_cast<int>(frames.size()) < config.frames_min) {
    return fail(Fault::too_few_points,
                "only " + std::to_string(frames.size()) +
                    " pictures show four LEDs apart from a new place, " +
                    std::to_string(config.frames_min) +
                    " are needed: record some ten seconds of flight 0.4 to 1 m from "
                    "the camera, with slow turns to both sides");
  }
  const auto alone = seen_alone(leds, all);
  for (int i = 0; i < leds.size(); ++i) {
    const int count = alone[static_cast<std::size_t>(i)];
    if (count >= config.alone_min) continue;
    const std::string near = neighbours(i, all);
    return fail(
        Fault::too_few_points,
        "LED " + std::to_string(i) + " is seen by itself in " + std::to_string(count) +
            " pictures" +
            (near.empty() ? std::string() : ", else run together with LED " + near) +
            "; fly nearer and turn the drone until it stands apart, or see "
            "whether it is lit");
  }
  return {};
}

/// Largest angle between directions to the lens, seen from the drone, deg.
double aspect_deg(const Camera& camera, const Frames& frames) {
  Vector3 mean = Vector3::Zero();
  std::vector<Vector3> all;
  for (const ObservedFrame& frame : frames) {
    const Vector3 p_BC = frame.X_NB.inverse() * camera.X_NC.translation();
    all.push_back(p_BC.normalized());
    mean += all.back();
  }
  mean.normalize();
  double most = 0;
  for (const Vector3& d : all) {
    most = std::max(most, std::acos(std::clamp(d.dot(mean), -1.0, 1.0)));
  }
  return 2 * most / kDegree;
}

Result<void> sure_enough(const ConstellationConfig& config, const Camera& camera,
                         const Eigen::VectorXd& form_sd_m, const Frames& frames) {
  Eigen::Index at = 0;
  const double worst = form_sd_m.maxCoeff(&at);
  const Eigen::Index led = at / 3;
  if (worst <= config.led_sd_max_m) return {};
  std::vector<double> range;
  for (const ObservedFrame& frame : frames) {
    range.push_back((frame.X_NB.translation() - camera.X_NC.translation()).norm());
  }
  const auto [low, high] = std::minmax_element(range.begin(), range.end());
  std::ostringstream text;
  text << std::fixed << std::setprecision(1) << "the pictures leave LED " << led
       << " uncertain by " << worst * 1e3 << " mm (1 sd; " << config.led_sd_max_m * 1e3
       << " mm is the most): " << frames.size() << " pictures, seen from directions "
       << std::setprecision(0) << aspect_deg(camera, frames) << " deg apart, "
       << std::setprecision(1) << *low << " to " << *high
       << " m away; record more, nearer (0.4 to 1 m), and yaw the drone 30 deg to both "
          "sides";
  return fail(Fault::degenerate, text.str());
}

SizeFrom size_from(const LedAdjustmentConfig& config, const Frames& frames) {
  if (!config.distances.empty()) return SizeFrom::distances;
  if (!config.use_depth) return SizeFrom::prior;
  for (const ObservedFrame& frame : frames) {
    for (const LedObservation& o : frame.seen) {
      if (o.depth_m > 0) return SizeFrom::depth;
    }
  }
  return SizeFrom::prior;
}

/// Of every picture that shows four lights or more, LEDs that run together, too: most
/// of a flight is farther away than where they all stand apart.
Frames with_poses(const Camera& camera, const Constellation& leds,
                  std::span<const ObservedFrame> frames) {
  Frames out;
  for (const ObservedFrame& frame : frames) {
    if (frame.seen.size() < 4) continue;
    const auto fit =
        refine_pose(camera, leds, {frame.seen.data(), frame.seen.size()}, frame.X_NB);
    if (!fit || !(fit->rms_px < kFitsPx)) continue;
    out.push_back(frame);
    out.back().X_NB = fit->X_NB;
  }
  return out;
}

/// The whole turned as the prior and what the thrust says of it have it, together.
void turn_by_thrust(const ConstellationConfig& config, const Matrix3& prior,
                    const Frames& frames, ConstellationFit& fit) {
  fit.turn_sd_rad = prior.diagonal().cwiseSqrt();
  if (!config.use_thrust) {
    fit.no_thrust = "not asked for";
    return;
  }
  const auto axis = find_thrust_axis(config.thrust, frames);
  if (!axis) {
    fit.no_thrust = axis.error().detail;
    return;
  }
  fit.thrust = *axis;
  const Eigen::Matrix2d S = prior.topLeftCorner<2, 2>() + axis->cov;
  const Eigen::Matrix<double, 3, 2> K = prior.leftCols<2>() * S.inverse();
  const Matrix3 turn = so3_exp(K * axis->turn_rad);
  fit.turn_sd_rad = (prior - K * prior.topRows<2>()).diagonal().cwiseSqrt();
  const Vector3 middle = fit.leds.middle_B();
  for (int i = 0; i < fit.leds.size(); ++i) {
    Vector3& p_BL = fit.leds.leds[static_cast<std::size_t>(i)].p_BL;
    p_BL = middle + turn * (p_BL - middle);
  }
}

}  // namespace

const char* to_string(SizeFrom from) {
  switch (from) {
    case SizeFrom::distances:
      return "distances";
    case SizeFrom::depth:
      return "depth";
    case SizeFrom::prior:
      break;
  }
  return "prior";
}

Result<void> distances_hold(const LedAdjustmentConfig& config,
                            const Constellation& written) {
  for (const LedDistance& d : config.distances) {
    const std::string name = std::to_string(d.i) + "," + std::to_string(d.j);
    if (d.i < 0 || d.j < 0 || d.i == d.j || std::max(d.i, d.j) >= written.size()) {
      return fail(Fault::invalid_config,
                  "distance " + name + ": the rig's LEDs are 0 to " +
                      std::to_string(written.size() - 1) + ", two different ones");
    }
    const double as_written = (written.p_BL(d.i) - written.p_BL(d.j)).norm();
    const double sd = std::hypot(d.sd_m, std::sqrt(2.0) * config.led_sd_m);
    const double most = std::max(5 * sd, kDistanceOff * as_written);
    if (std::abs(d.distance_m - as_written) <= most) continue;
    std::ostringstream text;
    text << "distance " << name << ": " << d.distance_m << " m, the rig file says "
         << std::setprecision(4) << as_written
         << " m; that is too far apart (metres? the right LEDs, counted from 0?)";
    return fail(Fault::invalid_config, text.str());
  }
  return {};
}

Result<ConstellationFit> calibrate_constellation(
    const ConstellationConfig& config, const Camera& camera,
    const Constellation& written, const Constellation& start,
    std::span<const ObservedFrame> frames) {
  if (auto good = distances_hold(config.adjustment, written); !good) {
    return fail(good.error());
  }
  const Frames all = usable(frames, config.use_merged);
  if (auto good = enough(config, written, all, frames); !good)
    return fail(good.error());
  const auto found = adjust_leds(config.adjustment, camera, written, start, all);
  if (!found) {
    return fail(found.error().fault,
                "the pictures contradict each other: are these LEDs those of the rig "
                "file, in its order, and the camera its camera?");
  }

  ConstellationFit fit;
  fit.leds = found->leds;
  for (int i = 0; i < written.size(); ++i) {
    fit.sd_m.push_back(found->cov_shape.diagonal().segment<3>(3 * i).cwiseSqrt());
  }
  fit.shift_sd_m = found->shift_sd_m;
  fit.size_sd = found->scale_sd;
  fit.size_from = size_from(config.adjustment, all);
  fit.depth_scale = found->depth_scale;
  fit.observations = found->observations;
  fit.rejected = found->rejected;
  fit.alone = seen_alone(written, frames);
  Frames kept;
  for (std::size_t f = 0; f < all.size(); ++f) {
    if (!std::isfinite(found->rms_px[f])) continue;
    kept.push_back(all[f]);
    kept.back().X_NB = found->poses[f];
  }
  fit.frames = static_cast<int>(kept.size());
  fit.frames_dropped = static_cast<int>(all.size() - kept.size());
  if (auto good = enough(config, written, kept, kept); !good) return fail(good.error());
  if (auto good = sure_enough(config, camera, found->form_sd_m, kept); !good) {
    return fail(good.error());
  }
  fit.rms_before_px = rms_of(camera, written, kept);
  fit.rms_px = rms_of(camera, fit.leds, kept);

  Frames used, held_out;
  for (std::size_t f = 0; f < kept.size(); ++f) {
    const bool out = f % static_cast<std::size_t>(config.hold_out) == 0;
    (out ? held_out : used).push_back(kept[f]);
  }
  const auto without = adjust_leds(config.adjustment, camera, written, start, used);
  if (!without) return fail(without.error().fault, "too few pictures to hold any out");
  fit.rms_held_out_px = rms_of(camera, without->leds, held_out);
  fit.frames_held_out = static_cast<int>(held_out.size());
  turn_by_thrust(config, found->turn_cov_rad2, with_poses(camera, fit.leds, frames),
                 fit);
  return fit;
}

}  // namespace alight
