#include "alight/peers/kf_less.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "alight/base/bounds.h"
#include "alight/peers/robust_fit.h"

namespace alight {

Result<void> KfLessConfig::validate() const {
  if (auto good = blobs.validate(); !good) return good;
  FirstComplaint check;
  check.range("kf_less.width_height_max", width_height_max, 0, 10);
  check.range("kf_less.circle_max", circle_max, 0, 10);
  check.range("kf_less.back_projection_px", voting.back_projection_px, 0.01, 100);
  check.range("kf_less.certainty", voting.certainty, 0, 1);
  check.range("kf_less.valid_share", voting.valid_share, 0, 1);
  check.range("kf_less.nearest_px", nearest_px, 0.01, 100);
  check.range("kf_less.huber_px", huber_px, 0.01, 100);
  check.range("kf_less.sd_px", sd_px, 0.001, 100);
  check.range("kf_less.rms_max_px", rms_max_px, 0.01, 100);
  check.range("kf_less.search_lights_max", search_lights_max, 4, 64);
  check.range("kf_less.predict_max_s", predict_max_s, 0, 10);
  check.range("kf_less.roi_margin_px", roi_margin_px, 0, 1000);
  return check.result();
}

Result<std::unique_ptr<Peer>> KfLess::create(const KfLessConfig& config,
                                             const Rig& rig) {
  if (auto good = rig.validate(); !good) return fail(good.error());
  if (auto good = config.validate(); !good) return fail(good.error());
  const Intrinsics& lens = rig.camera.intrinsics;
  auto detector = BlobDetector::create(config.blobs, lens.width, lens.height);
  if (!detector) return fail(detector.error());
  return std::unique_ptr<Peer>(new KfLess(config, rig, std::move(*detector)));
}

KfLess::KfLess(const KfLessConfig& config, const Rig& rig, BlobDetector detector)
    : config_(config),
      camera_(rig.camera),
      leds_(rig.leds),
      detector_(std::move(detector)),
      voting_(config.voting, rig.camera.intrinsics, rig.leds) {}

PeerReport KfLess::fuse(Time t, const ImageView& color, const DepthView& depth) {
  PeerReport out;
  Pose X_NB;
  const bool predicted = predict(t, X_NB);
  if (predicted) {
    const Roi part = roi(X_NB);
    const auto blobs = part.empty() ? Result<BlobSpan>(BlobSpan())
                                    : detector_.detect(color, depth, part);
    if (blobs) see(*blobs, out);
    out.tracked = blobs && follow(X_NB, out);
  }
  if (!out.tracked) {
    const auto blobs = detector_.detect(color, depth);
    if (!blobs) {
      out.why_not = "the picture cannot be read";
      sights_ = 0;
      return out;
    }
    see(*blobs, out);
    out.tracked = out.initialized = search(out);
  }
  if (!out.tracked) {
    sights_ = 0;
    return out;
  }
  before_ = last_;
  last_ = {t, out.X_NB};
  // Across a new search the pose may jump: that is no motion.
  sights_ = out.initialized ? 1 : 2;
  ever_ = true;
  return out;
}

bool KfLess::predict(Time t, Pose& X_NB) const {
  if (sights_ == 0) return false;
  const double ahead = to_seconds(t - last_.t);
  if (!(ahead > 0 && ahead < config_.predict_max_s)) return false;
  X_NB = last_.X_NB;
  if (sights_ < 2) return true;
  // Constant velocity, linear and angular: the last change again, as long as it takes.
  const double share = ahead / to_seconds(last_.t - before_.t);
  const Vector3 moved = last_.X_NB.translation() - before_.X_NB.translation();
  const Vector3 turned =
      so3_log(before_.X_NB.linear().transpose() * last_.X_NB.linear());
  X_NB = make_pose(last_.X_NB.linear() * so3_exp(share * turned),
                   last_.X_NB.translation() + share * moved);
  return true;
}

void KfLess::see(BlobSpan blobs, PeerReport& out) {
  lights_.uv.clear();
  lights_.rays.clear();
  brightness_.clear();
  out.blobs = static_cast<int>(blobs.size());
  out.refused.clear();
  for (const Blob& blob : blobs) {
    const double w = blob.box.u1 - blob.box.u0, h = blob.box.v1 - blob.box.v0;
    const bool shaped = blob.area_px >= config_.shape_area_px;
    const double circle = blob.area_px / (0.25 * kPi * std::max(w, h) * std::max(w, h));
    if (shaped && (std::abs(1 - w / h) > config_.width_height_max ||
                   std::abs(1 - circle) > config_.circle_max)) {
      out.refused.push_back({blob.uv, Refusal::too_large});
      continue;
    }
    lights_.uv.push_back(blob.uv);
    lights_.rays.push_back(camera_.intrinsics.unproject(blob.uv));
    brightness_.push_back(blob.brightness);
  }
}

Roi KfLess::roi(const Pose& X_NB) const {
  Vector2 low(1e9, 1e9), high(-1e9, -1e9);
  for (const Led& led : leds_.leds) {
    const auto uv = project_led(camera_, X_NB, led.p_BL);
    if (!uv) return {};
    low = low.cwiseMin(*uv);
    high = high.cwiseMax(*uv);
  }
  const double m = config_.roi_margin_px;
  const auto cut = [](double x, int end) {
    return static_cast<int>(std::clamp(x, 0.0, static_cast<double>(end)));
  };
  const Intrinsics& lens = camera_.intrinsics;
  return {cut(low.x() - m, lens.width), cut(low.y() - m, lens.height),
          cut(high.x() + m + 1, lens.width), cut(high.y() + m + 1, lens.height)};
}

bool KfLess::follow(const Pose& X_NB, PeerReport& out) {
  // Every LED takes its nearest light; of two that want the same the nearer has it.
  struct Offer {
    double distance2 = 0;
    LedMatch match;
  };
  FixedVector<Offer, kMaxLeds> offers;
  for (int m = 0; m < leds_.size(); ++m) {
    const auto uv = project_led(camera_, X_NB, leds_.p_BL(m));
    if (!uv) continue;
    Offer best{config_.nearest_px * config_.nearest_px, {m, -1}};
    for (int d = 0; d < lights_.size(); ++d) {
      const double distance2 =
          (*uv - lights_.uv[static_cast<std::size_t>(d)]).squaredNorm();
      if (distance2 < best.distance2) best = {distance2, {m, d}};
    }
    if (best.match.light >= 0) offers.push_back(best);
  }
  LedMatches matches;
  for (const Offer& offer : offers) {
    const bool outdone =
        std::any_of(offers.begin(), offers.end(), [&](const Offer& other) {
          return other.match.light == offer.match.light &&
                 other.match.led != offer.match.led &&
                 (other.distance2 < offer.distance2 ||
                  (other.distance2 == offer.distance2 &&
                   other.match.led < offer.match.led));
        });
    if (!outdone) matches.push_back(offer.match);
  }
  Pose X_CB;
  if (!voting_.agree(lights_, matches, X_CB)) {
    out.why_not = "too few lights where the LEDs are expected";
    return false;
  }
  return fit(matches, camera_.X_NC * X_CB, out);
}

void KfLess::keep_nearest(std::size_t count) {
  if (lights_.uv.size() <= count) return;
  std::vector<std::size_t> order(lights_.uv.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto expected =
      ever_ ? project_led(camera_, last_.X_NB, Vector3::Zero()) : std::nullopt;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    if (!expected) return brightness_[a] > brightness_[b];
    return (lights_.uv[a] - *expected).squaredNorm() <
           (lights_.uv[b] - *expected).squaredNorm();
  });
  Lights kept;
  for (std::size_t i = 0; i < count; ++i) {
    kept.uv.push_back(lights_.uv[order[i]]);
    kept.rays.push_back(lights_.rays[order[i]]);
  }
  lights_ = std::move(kept);
}

bool KfLess::search(PeerReport& out) {
  keep_nearest(static_cast<std::size_t>(config_.search_lights_max));
  const LedMatches matches = voting_.search(lights_);
  Pose X_CB;
  if (!voting_.agree(lights_, matches, X_CB)) {
    out.why_not = lights_.size() < 4 ? "fewer than four lights"
                                     : "no pose brings LEDs and lights together";
    return false;
  }
  return fit(matches, camera_.X_NC * X_CB, out);
}

bool KfLess::fit(const LedMatches& matches, const Pose& X_NB_0, PeerReport& out) const {
  out.seen.clear();
  for (const LedMatch& match : matches) {
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << match.led);
    o.uv = lights_.uv[static_cast<std::size_t>(match.light)];
    o.cov = config_.sd_px * config_.sd_px * Matrix2::Identity();
    out.seen.push_back(o);
  }
  const auto found = robust_fit(camera_, leds_, {out.seen.data(), out.seen.size()},
                                X_NB_0, config_.sd_px, config_.huber_px);
  if (!found || found->rms_px > config_.rms_max_px) {
    out.seen.clear();
    out.why_not = "no pose fits the LEDs";
    return false;
  }
  out.X_NB = found->X_NB;
  out.cov = found->cov;
  out.reprojection_px = found->rms_px;
  out.why_not = "";
  return true;
}

}  // namespace alight
