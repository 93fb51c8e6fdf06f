#include "alight/vision/led_tracker.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <sstream>

#include "alight/base/median.h"
#include "alight/vision/led_matcher.h"

namespace alight {
namespace {

// sd by which an LED may miss its place: a pose fitted to all takes up some of it.
constexpr double kLedGate = 2.5;
// LEDs seen in their own colour from which on the others must be, too.
constexpr std::size_t kEnoughColored = 3;

/// How the picture differs from the predicted one: p -> middle + m (p - middle) +
/// shift, with m = (1 + growth) e^(i turn) as a complex number.
struct Shift {
  Vector2 shift = Vector2::Zero();
  double re = 1, im = 0;

  Vector2 operator()(const Vector2& from_middle) const {
    return {re * from_middle.x() - im * from_middle.y() + shift.x(),
            im * from_middle.x() + re * from_middle.y() + shift.y()};
  }
};

/// Pixel covariance of the constellation's middle by the prediction's own.
Matrix2 middle_covariance(const Camera& camera, const Constellation& leds,
                          const Pose& X_NB, const Matrix6& cov) {
  const auto all = static_cast<std::uint16_t>((1u << leds.size()) - 1);
  Matrix26 J;
  if (!project_observation(camera, X_NB, leds, all, &J)) return Matrix2::Zero();
  const Matrix2 S = J * cov * J.transpose();
  return S.allFinite() ? S : Matrix2(Matrix2::Zero());
}

using Near = FixedVector<int, 64>;

/// Blobs that may be LEDs at all, in their own order; the strongest of a picture full
/// of noise in any.
Near strongest_near(BlobSpan blobs, const Vector2& middle, double reach_px) {
  Near near;
  const auto light = [&](int j) {
    return blobs[static_cast<std::size_t>(j)].brightness;
  };
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    if (blobs[j].cut || blobs[j].stray || (blobs[j].uv - middle).norm() > reach_px)
      continue;
    if (near.push_back(static_cast<int>(j))) continue;
    const auto faintest =
        std::min_element(near.begin(), near.end(),
                         [&](int a, int b) { return light(a) < light(b); }) -
        near.begin();
    if (light(near[static_cast<std::size_t>(faintest)]) >= blobs[j].brightness)
      continue;
    near.erase(static_cast<std::size_t>(faintest));
    near.push_back(static_cast<int>(j));
  }
  return near;
}

double largest_sd(const Matrix2& S) {
  const double half = S.trace() / 2;
  const double gap = std::sqrt(std::max(half * half - S.determinant(), 0.0));
  return std::sqrt(std::max(half + gap, 0.0));
}

}  // namespace

Result<void> LedTrackerConfig::validate() const {
  struct Field {
    const char* name;
    double value, low, high;
  };
  const Field fields[] = {{"shift_sd_px", shift_sd_px, 0, 500},
                          {"scale_sd", scale_sd, 0, 1},
                          {"turn_sd_deg", turn_sd_deg, 0, 90},
                          {"gate_sd", gate_sd, 0.5, 20},
                          {"match_px", match_px, 0.1, 100},
                          {"match_share", match_share, 0, 1},
                          {"led_sd_m", led_sd_m, 0, 0.1},
                          {"merge_px", merge_px, 0, 50},
                          {"merged_imbalance", merged_imbalance, 0, 1},
                          {"roi_margin_px", roi_margin_px, 0, 10000},
                          {"paper_gate_px", paper_gate_px, 0.1, 10000}};
  for (const Field& f : fields) {
    if (f.value >= f.low && f.value <= f.high) continue;
    std::ostringstream text;
    text << "tracker." << f.name << " is " << f.value << ", must lie in [" << f.low
         << ", " << f.high << "]";
    return fail(Fault::invalid_config, text.str());
  }
  return {};
}

Result<LedTracker> LedTracker::create(const LedTrackerConfig& config,
                                      const Camera& camera, const Constellation& leds) {
  if (const auto valid = config.validate(); !valid) return fail(valid.error());
  if (leds.size() < 1) return fail(Fault::invalid_config, "the rig has no LEDs");
  return LedTracker(config, camera, leds);
}

Roi LedTracker::roi(const Pose& X_NB, const Matrix6& cov) const {
  const LedImages images = led_images(camera_, leds_, X_NB);
  if (images.count == 0) return {};
  const double middle_sd =
      largest_sd(middle_covariance(camera_, leds_, X_NB, cov)) + config_.shift_sd_px;
  const double margin = config_.roi_margin_px + config_.gate_sd * middle_sd +
                        config_.gate_sd *
                            (config_.scale_sd + config_.turn_sd_deg * kDegree) *
                            images.size_px;
  Vector2 low = images.middle, high = images.middle;
  for (int i = 0; i < leds_.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    if (!images.in_front[n]) continue;
    low = low.cwiseMin(images.uv[n]);
    high = high.cwiseMax(images.uv[n]);
  }
  const Intrinsics& lens = camera_.intrinsics;
  // Cut before the cast: an image far outside does not fit an int.
  const auto cut = [](double x, int most) {
    return static_cast<int>(std::clamp(x, 0.0, static_cast<double>(most)));
  };
  const Roi out{cut(std::floor(low.x() - margin), lens.width),
                cut(std::floor(low.y() - margin), lens.height),
                cut(std::ceil(high.x() + margin) + 1, lens.width),
                cut(std::ceil(high.y() + margin) + 1, lens.height)};
  return out.empty() ? Roi{} : out;
}

LedFrame LedTracker::track(BlobSpan blobs, const Pose& X_NB_predicted,
                           const Matrix6& cov, Time t, TrackDetail* detail) const {
  if (config_.profile == LedTrackerConfig::Profile::paper) {
    return track_paper(blobs, X_NB_predicted, t);
  }
  LedFrame frame;
  frame.t = t;
  LedImages images = led_images(camera_, leds_, X_NB_predicted);
  bool white_is_any = true;
  double area_max = 1e9;
  const auto refuse_rest = [&](const Assignment& used, const Assignment& dropped) {
    for (std::size_t j = 0; j < blobs.size(); ++j) {
      const auto shows = [&](const Assignment& a) {
        return std::find(a.blob.begin(), a.blob.end(), static_cast<int>(j)) !=
               a.blob.end();
      };
      if (shows(used)) continue;
      RefusedBlob refused{blobs[j].uv, Refusal::no_led_near};
      double nearest = config_.match_px + config_.match_share * images.size_px;
      for (int i = 0; i < leds_.size(); ++i) {
        const auto n = static_cast<std::size_t>(i);
        const double d = (blobs[j].uv - images.uv[n]).norm();
        if (!images.in_front[n] || d > nearest) continue;
        nearest = d;
        refused.reason = colors_agree(blobs[j].color, leds_.color(i), white_is_any)
                             ? Refusal::other_is_nearer
                             : Refusal::wrong_color;
      }
      if (blobs[j].area_px > area_max) refused.reason = Refusal::too_large;
      if (blobs[j].cut) refused.reason = Refusal::cut_by_edge;
      if (blobs[j].stray) refused.reason = Refusal::stray;
      if (shows(dropped)) refused.reason = Refusal::off_constellation;
      frame.refused.push_back(refused);
    }
  };
  if (images.count < leds_.size() || blobs.empty()) {
    refuse_rest({}, {});
    return frame;
  }

  // 1. What the picture may have done since it was predicted.
  const Matrix2 S = middle_covariance(camera_, leds_, X_NB_predicted, cov) +
                    config_.shift_sd_px * config_.shift_sd_px * Matrix2::Identity();
  const Matrix2 W = S.inverse();
  const double gate2 = config_.gate_sd * config_.gate_sd;
  const double turn_sd = std::max(config_.turn_sd_deg * kDegree, 1e-6);
  const double scale_sd = std::max(config_.scale_sd, 1e-6);
  const double slack =
      config_.gate_sd * (largest_sd(S) + (scale_sd + turn_sd) * images.size_px);
  Near near =
      strongest_near(blobs, images.middle, images.size_px + slack + config_.match_px);
  // Where LEDs show their colours, what is white or far larger is a lamp, alone or run
  // together with an LED.
  if (config_.use_color) {
    FixedVector<double, Near::capacity()> areas;
    for (const int j : near) {
      const Blob& blob = blobs[static_cast<std::size_t>(j)];
      const auto is_its = [&](const Led& led) { return led.color == blob.color; };
      if (blob.color != LedColor::none && blob.color != LedColor::white &&
          std::any_of(leds_.leds.begin(), leds_.leds.end(), is_its)) {
        areas.push_back(blob.area_px);
      }
    }
    if (areas.size() >= kEnoughColored) {
      white_is_any = false;
      area_max = kLargestImage * median(areas.begin(), areas.end());
      Near kept;
      for (const int j : near) {
        if (blobs[static_cast<std::size_t>(j)].area_px <= area_max) kept.push_back(j);
      }
      near = kept;
    }
  }

  // 2. The similarity that explains most, found from every LED and every pair of LEDs.
  const double range =
      (X_NB_predicted.translation() - camera_.X_NC.translation()).norm();
  const double led_px =
      config_.led_sd_m * camera_.intrinsics.fx / std::max(range, 0.05);
  const double loose = config_.match_px + kLedGate * led_px;
  const double tolerance = loose + config_.match_share * images.size_px;
  const double fine2 = tolerance * tolerance;
  std::array<Vector2, kMaxLeds> from_middle;
  for (int i = 0; i < leds_.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    from_middle[n] = images.uv[n] - images.middle;
  }
  const auto agrees = [&](const Blob& blob, int i) {
    return !config_.use_color || colors_agree(blob.color, leds_.color(i), white_is_any);
  };
  std::array<Vector2, Near::capacity()> near_uv;
  std::array<std::uint16_t, Near::capacity()> near_fits;  // the LEDs that it may show
  for (std::size_t m = 0; m < near.size(); ++m) {
    const Blob& blob = blobs[static_cast<std::size_t>(near[m])];
    near_uv[m] = blob.uv;
    near_fits[m] = 0;
    for (int i = 0; i < leds_.size(); ++i) {
      near_fits[m] = static_cast<std::uint16_t>(near_fits[m] | agrees(blob, i) << i);
    }
  }
  const double turn_most = config_.gate_sd * turn_sd;
  const double slope_most = turn_most < 1.5 ? 1.001 * std::tan(turn_most) : 0;
  Shift best;
  double best_score = -1e9;
  const auto offer = [&](const Shift& s) {
    // Most are turned too far, or too far off to be better whatever they explain.
    if (slope_most > 0 && !(std::abs(s.im) <= slope_most * s.re)) return;
    const double growth = (std::sqrt(s.re * s.re + s.im * s.im) - 1) / scale_sd;
    const double far = s.shift.dot(W * s.shift);
    if (far > 2 * gate2 || growth * growth > gate2) return;
    if (leds_.size() - 0.08 * (far + growth * growth) < best_score) return;
    const double turn = std::atan2(s.im, s.re) / turn_sd;
    if (turn * turn > gate2) return;
    double score = -0.08 * (far + growth * growth + turn * turn);
    for (int i = 0; i < leds_.size(); ++i) {
      if (score + (leds_.size() - i) < best_score) return;
      const Vector2 uv = images.middle + s(from_middle[static_cast<std::size_t>(i)]);
      double nearest = fine2;
      for (std::size_t m = 0; m < near.size(); ++m) {
        const double d2 = (near_uv[m] - uv).squaredNorm();
        if (d2 < nearest && ((near_fits[m] >> i) & 1)) nearest = d2;
      }
      score += 1 - nearest / fine2;
    }
    if (score > best_score) {
      best_score = score;
      best = s;
    }
  };
  offer({});
  for (int i = 0; i < leds_.size(); ++i) {
    const Vector2 q_i = from_middle[static_cast<std::size_t>(i)];
    for (std::size_t a = 0; a < near.size(); ++a) {
      const Vector2 r_a = near_uv[a] - images.middle;
      if (!((near_fits[a] >> i) & 1) || (r_a - q_i).norm() > slack) continue;
      Shift plain;
      plain.shift = r_a - q_i;
      offer(plain);
      for (int k = i + 1; k < leds_.size(); ++k) {
        const Vector2 q = from_middle[static_cast<std::size_t>(k)] - q_i;
        const double qq = q.squaredNorm();
        // Two images close together say little of size and direction.
        if (qq < 0.25 * images.size_px * images.size_px || qq < 4) continue;
        for (std::size_t b = 0; b < near.size(); ++b) {
          if (b == a || !((near_fits[b] >> k) & 1)) continue;
          const Vector2 r = near_uv[b] - near_uv[a];
          Shift s;
          s.re = q.dot(r) / qq;
          s.im = (q.x() * r.y() - q.y() * r.x()) / qq;
          s.shift = r_a - s(q_i);
          offer(s);
        }
      }
    }
  }

  // 3. One blob to one LED under that, and the pose that follows.
  LedImages shifted = images;
  for (int i = 0; i < leds_.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    shifted.uv[n] = images.middle + best(from_middle[n]);
  }
  const std::span<const int> candidates(near.data(), near.size());
  MatchRule rule{tolerance, config_.merge_px, config_.use_color, white_is_any};
  Assignment match = match_leds(shifted, leds_, blobs, candidates, rule);

  // 4. Refine from the prediction, look again where the LEDs then must be, and drop
  // what
  //    contradicts the rest.
  Matrix6 prior = Matrix6::Zero();
  const double shift_m =
      range * (config_.shift_sd_px + largest_sd(S)) / camera_.intrinsics.fx;
  for (int k = 0; k < 3; ++k) {
    const double p_sd =
        shift_m + scale_sd * range + std::sqrt(std::max(cov(k, k), 0.0));
    const double turn = 3 * turn_sd + std::sqrt(std::max(cov(k + 3, k + 3), 0.0));
    prior(k, k) = 1 / (p_sd * p_sd);
    prior(k + 3, k + 3) = 1 / (turn * turn);
  }
  Assignment dropped;
  for (int pass = 0; pass < 3 && match.blobs > 0; ++pass) {
    auto seen = observations(match, shifted, blobs, config_.merged_imbalance);
    for (LedObservation& o : seen) {
      o.cov += (0.25 + led_px * led_px) * Matrix2::Identity();
      if (!std::has_single_bit(o.leds)) continue;
      // Another LED may hide in its blob.
      const auto k = static_cast<std::size_t>(std::countr_zero(o.leds));
      for (std::size_t i = 0; i < static_cast<std::size_t>(leds_.size()); ++i) {
        const Vector2 apart = shifted.uv[i] - shifted.uv[k];
        if (match.blob[i] >= 0 || apart.norm() > config_.merge_px) continue;
        o.cov += 0.25 * apart * apart.transpose();
      }
    }
    const auto fit = refine_pose(camera_, leds_, {seen.data(), seen.size()},
                                 X_NB_predicted, &prior, 6);
    if (!fit) break;
    shifted = led_images(camera_, leds_, fit->X_NB);
    rule.tolerance_px = loose + config_.match_share * shifted.size_px / 2;
    const Assignment again = match_leds(shifted, leds_, blobs, candidates, rule);
    for (std::size_t i = 0; i < kMaxLeds; ++i) {
      if (match.blob[i] >= 0 && again.blob[i] < 0) dropped.blob[i] = match.blob[i];
    }
    if (again == match) break;
    match = again;
  }
  frame.seen = observations(match, shifted, blobs, config_.merged_imbalance);
  images = shifted;
  if (detail != nullptr) *detail = {shifted, match, X_NB_predicted, prior};
  refuse_rest(match, dropped);
  return frame;
}

LedFrame LedTracker::track_paper(BlobSpan blobs, const Pose& X_NB, Time t) const {
  LedFrame frame;
  frame.t = t;
  LedImages images = led_images(camera_, leds_, X_NB);
  if (images.count < leds_.size() || blobs.empty()) return frame;
  Vector2 middle = Vector2::Zero();
  for (const Blob& blob : blobs) middle += blob.uv / static_cast<double>(blobs.size());
  const Vector2 shift = middle - images.middle;
  std::array<int, kMaxLeds> taken_by;
  taken_by.fill(-1);
  for (int i = 0; i < leds_.size(); ++i) {
    const Vector2 uv = images.uv[static_cast<std::size_t>(i)] + shift;
    double nearest = config_.paper_gate_px;
    for (std::size_t j = 0; j < blobs.size(); ++j) {
      const double d = (blobs[j].uv - uv).norm();
      if (d >= nearest) continue;
      nearest = d;
      taken_by[static_cast<std::size_t>(i)] = static_cast<int>(j);
    }
    const int j = taken_by[static_cast<std::size_t>(i)];
    if (j < 0) continue;
    const Blob& blob = blobs[static_cast<std::size_t>(j)];
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << i);
    o.uv = blob.uv;
    o.cov = blob.cov;
    o.depth_m = blob.depth_m;
    frame.seen.push_back(o);
  }
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    if (std::find(taken_by.begin(), taken_by.end(), static_cast<int>(j)) ==
        taken_by.end()) {
      frame.refused.push_back({blobs[j].uv, Refusal::no_led_near});
    }
  }
  return frame;
}

}  // namespace alight
