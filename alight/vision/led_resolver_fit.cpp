// How LedResolver takes LEDs whose images touch apart.
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alight/vision/led_resolver_parts.h"

namespace alight {
namespace {

constexpr double kDark = 0.08;        // share of the brightest that is no light
constexpr double kVagueSd = 3;        // px; an LED less well placed is not seen
constexpr double kForeignReach = 40;  // px
constexpr double kDimLeast = 12;      // grey levels of an LED without a blob, with it
constexpr double kUnexplained = 2;    // times the usual chi2 leave room for a dead LED
// From so many times its usual value on it is no noise: the edge of something that
// covers part of a light leaves residuals side by side, which pull it by as much more,
// at most.
constexpr double kEdge = 4, kEdgePull2 = 6;
// What a model of lights lacks moves those that run together: the variance of their
// places, by that of lights with as much noise alone.
constexpr double kTogether = 1.35;
// Skirts of lights farther off do not matter, px.
constexpr double kBesidePx = 9;
// A light of its own is about as long as wide, in px^2 of variance, once its way during
// the exposure is taken off; noise makes a small one longer than that.
constexpr double kLongest = 2.5, kLongLeast = 1.5;

/// Takes the LEDs for which `keep` is false out of the information, the rest being
/// told without them.
GroupMatrix marginal(const GroupMatrix& information, std::span<const int> keep) {
  const auto n = static_cast<Eigen::Index>(keep.size());
  const Eigen::Index all = information.rows() / 2;
  if (n == all) return information;
  FixedVector<int, kMaxGroup> drop;
  for (int i = 0; i < static_cast<int>(all); ++i) {
    if (std::find(keep.begin(), keep.end(), i) == keep.end()) drop.push_back(i);
  }
  const auto block = [&](std::span<const int> rows, std::span<const int> columns) {
    GroupMatrix out(2 * static_cast<Eigen::Index>(rows.size()),
                    2 * static_cast<Eigen::Index>(columns.size()));
    for (std::size_t i = 0; i < rows.size(); ++i) {
      for (std::size_t j = 0; j < columns.size(); ++j) {
        out.block<2, 2>(2 * static_cast<Eigen::Index>(i),
                        2 * static_cast<Eigen::Index>(j)) =
            information.block<2, 2>(2 * rows[i], 2 * columns[j]);
      }
    }
    return out;
  };
  const std::span<const int> gone(drop.data(), drop.size());
  GroupMatrix H_dd = block(gone, gone);
  H_dd.diagonal().array() += 1e-6;
  const GroupMatrix H_kd = block(keep, gone);
  const Eigen::LLT<GroupMatrix> llt(H_dd);
  return block(keep, keep) - H_kd * llt.solve(H_kd.transpose());
}

/// All of its box; with a margin what its shape covers, lamps in a row taken for a bar.
ForeignLight foreign_light(const Blob& blob, int margin_px) {
  ForeignLight light{.box = blob.box};
  if (margin_px == 0) return light;
  light.box = {blob.box.u0 - margin_px, blob.box.v0 - margin_px,
               blob.box.u1 + margin_px, blob.box.v1 + margin_px};
  light.middle = blob.uv;
  const Vector2 stretch = stretch_of(blob.spread);
  const double turn = 0.5 * std::atan2(stretch.y(), stretch.x());
  light.along = Vector2(std::cos(turn), std::sin(turn));
  const double mean = 0.5 * blob.spread.trace(), half = 0.5 * stretch.norm();
  // An even bar reaches sqrt(3) standard deviations, its rim is dim.
  light.half_length = std::sqrt(3 * std::max(mean + half, 0.0)) + 1 + margin_px;
  light.half_width = std::sqrt(3 * std::max(mean - half, 0.0)) + 1 + margin_px;
  return light;
}

}  // namespace

/// A light that is as large as an LED near the lens, and run together with a lamp: its
/// middle is that of neither.
bool runs_on(const Blob& blob, const Vector2& blur_px) {
  const Vector2 stretch =
      stretch_of(blob.spread) - stretch_of(blur_px * blur_px.transpose() / 12);
  const double half = 0.5 * stretch.norm();
  const double narrow = 0.5 * (blob.spread.trace() - blur_px.squaredNorm() / 12) - half;
  return 2 * half > std::max((kLongest - 1) * narrow, kLongLeast);
}

LedResolver::Look LedResolver::look_at(const ImageView& image, BlobSpan blobs,
                                       const Assignment& match, const LedImages& images,
                                       std::span<const Vector2> blur_px,
                                       int margin_px) const {
  Look look{image, blobs, match, images, blur_px, margin_px};
  for (int i = 0; i < leds_.size(); ++i) {
    const auto n = static_cast<std::size_t>(i);
    if (images.in_front[n] && ((lit_ >> i) & 1)) {
      look.lights[n] = {images.uv[n], heights_[n], colors_[n]};
    }
  }
  return look;
}

LedResolver::Patches LedResolver::patches(const LedImages& images, BlobSpan blobs,
                                          const Assignment& match,
                                          bool* left_out) const {
  const auto n = static_cast<std::size_t>(leds_.size());
  std::array<std::size_t, kMaxLeds> group;
  for (std::size_t i = 0; i < n; ++i) group[i] = i;
  const double touch = config_.touch * spot_reach_px(spread_, Vector2::Zero());
  const auto touching = [&](std::size_t i, std::size_t k) {
    const bool shared = match.blob[i] >= 0 && match.blob[i] == match.blob[k];
    return images.in_front[i] && images.in_front[k] &&
           (shared || (images.uv[i] - images.uv[k]).norm() <= touch);
  };
  const auto dead = [&](std::size_t i) { return dark_[i] >= kDeadAfter; };
  std::array<bool, kMaxLeds> looked_for;
  for (std::size_t i = 0; i < n; ++i) {
    looked_for[i] = images.in_front[i];
    for (std::size_t k = 0; left_out != nullptr && k < n; ++k) {
      if (!dead(i) || dead(k) || !touching(i, k)) continue;
      looked_for[i] = false;
      *left_out = true;
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < i; ++k) {
      if (!looked_for[i] || !looked_for[k] || group[i] == group[k]) continue;
      if (!touching(i, k)) continue;
      const std::size_t from = group[i], to = group[k];
      for (std::size_t j = 0; j < n; ++j) {
        if (group[j] == from) group[j] = to;
      }
    }
  }
  Patches out;
  for (std::size_t g = 0; g < n; ++g) {
    Patch patch;
    for (std::size_t i = 0; i < n; ++i) {
      if (group[i] != g || !looked_for[i]) continue;
      patch.members.push_back(static_cast<int>(i));
      if (match.blob[i] < 0) continue;
      const Blob& blob = blobs[static_cast<std::size_t>(match.blob[i])];
      patch.area_px = std::max(patch.area_px, blob.area_px);
    }
    if (!patch.members.empty()) out.push_back(patch);
  }
  return out;
}

void LedResolver::fit(Look& look, Patch& patch) const {
  const Assignment& match = look.match;
  const BlobSpan blobs = look.blobs;
  const auto count = static_cast<double>(patch.members.size());
  if (patch.members.size() > kMaxGroup) return;
  if (patch.area_px > config_.area_max_px * count) return;
  FixedVector<LightSought, kMaxGroup> sought;
  Vector2 blur = Vector2::Zero();
  for (const int i : patch.members) {
    const auto n = static_cast<std::size_t>(i);
    sought.push_back({look.images.uv[n], heights_[n], colors_[n]});
    blur += look.blur_px[n] / count;
  }
  const int first = match.blob[static_cast<std::size_t>(patch.members[0])];
  if (sought.size() == 1 && first >= 0) {
    sought[0].uv = blobs[static_cast<std::size_t>(first)].uv;
  }
  FixedVector<ForeignLight, 32> foreign;
  for (std::size_t j = 0; j < blobs.size(); ++j) {
    if ((blobs[j].uv - sought[0].uv).cwiseAbs().maxCoeff() > kForeignReach) continue;
    if (is_used(match, static_cast<int>(j))) continue;
    foreign.push_back(foreign_light(blobs[j], look.margin_px));
  }
  FixedVector<LightBeside, kMaxLeds> beside;
  for (int i = 0; i < leds_.size(); ++i) {
    const LightBeside& light = look.lights[static_cast<std::size_t>(i)];
    if (!(light.height > 0) || std::find(patch.members.begin(), patch.members.end(),
                                         i) != patch.members.end()) {
      continue;
    }
    const auto near = [&](const LightSought& own) {
      return (own.uv - light.uv).norm() < kBesidePx;
    };
    if (std::any_of(sought.begin(), sought.end(), near)) beside.push_back(light);
  }
  auto found = fit_spots(look.image, {sought.data(), sought.size()}, spread_, blur,
                         {foreign.data(), foreign.size()},
                         {beside.data(), beside.size()}, &patch.unlike);
  if (!found) return;
  unsigned too_dim = 0;
  if (patch.area_px == 0) {
    const double least = kDimLeast * std::sqrt(spread_.noise_variance / kNoiseUsual);
    for (std::size_t k = 0; k < sought.size(); ++k) {
      if (found->height[k] < least ||
          (found->uv[k] - sought[k].uv).norm() > config_.dim_reach_px) {
        too_dim |= 1u << k;
      }
    }
    if (too_dim == (1u << sought.size()) - 1) return;
  }
  if (patch.fit && found->chi2_per_pixel > patch.fit->chi2_per_pixel) return;
  patch.fit = found;
  patch.feigned = too_dim | feigned(patch, {sought.data(), sought.size()});
  for (std::size_t k = 0; k < patch.members.size(); ++k) {
    const auto n = static_cast<std::size_t>(patch.members[k]);
    look.lights[n] = {found->uv[k], found->height[k], sought[k].color};
    if (!known(sought[k].color)) look.lights[n].color = found->color;
  }
}

unsigned LedResolver::feigned(const Patch& patch,
                              std::span<const LightSought> sought) const {
  const auto was_lit = [&](std::size_t k) { return (lit_ >> patch.members[k]) & 1; };
  const auto off = [&](std::size_t k) {
    return Vector2(patch.fit->uv[k] - sought[k].uv);
  };
  Vector2 common = Vector2::Zero();
  int lit = 0;
  for (std::size_t k = 0; k < sought.size(); ++k) {
    if (!was_lit(k)) continue;
    common += off(k);
    ++lit;
  }
  unsigned out = 0;
  for (std::size_t k = 0; lit > 0 && k < sought.size(); ++k) {
    const bool elsewhere = (off(k) - common / lit).norm() > config_.dim_reach_px;
    if (!was_lit(k) && elsewhere) out |= 1u << k;
  }
  return out;
}

bool LedResolver::unexplained(const Patch& patch) const {
  // Where no light is, none is missing.
  if (!patch.fit) return patch.area_px > 0;
  return patch.fit->chi2_per_pixel > kUnexplained * std::max(noise_, kNoiseLeast);
}

void LedResolver::add(const Patch& patch, BlobSpan blobs, const Assignment& match,
                      LedFrame& out) const {
  const SpotFit& fit = *patch.fit;
  const Eigen::Index n = 2 * fit.count;
  double brightest = 0;
  for (int k = 0; k < fit.count; ++k) {
    brightest = std::max(brightest, fit.height[static_cast<std::size_t>(k)]);
  }
  const auto marginals = [](const GroupMatrix& information) {
    GroupMatrix regular = information;
    regular.diagonal().array() += 1e-2;  // 10 px: known from elsewhere
    if (regular.rows() == 2) return GroupMatrix(Matrix2(regular).inverse());
    const Eigen::LLT<GroupMatrix> llt(regular);
    return GroupMatrix(
        llt.solve(GroupMatrix::Identity(information.rows(), information.cols())));
  };
  const double usual = std::max(noise_, kNoiseLeast);
  const double pull2 =
      std::clamp(fit.chi2_per_pixel / (kEdge * usual), 1.0, kEdgePull2);
  const double usual_here = fit.count > 1 ? kTogether * usual : usual;
  GroupMatrix measured =
      fit.information / (pull2 * std::max(fit.chi2_per_pixel, usual_here));
  const double spread_px = std::sqrt(spread_.variance_px2);
  for (int k = 0; k < fit.count; ++k) {
    const double off =
        share_.displaced_px(patch.members[static_cast<std::size_t>(k)], spread_px);
    if (off == 0) continue;
    // The light's own rows and columns, as if its place varied by so much more.
    const double share =
        1 / std::sqrt(1 + off * off * measured.diagonal().segment<2>(2 * k).mean());
    measured.middleRows<2>(2 * k) *= share;
    measured.middleCols<2>(2 * k) *= share;
  }
  const GroupMatrix cov_all = marginals(measured);
  FixedVector<int, kMaxGroup> keep;
  for (int k = 0; k < fit.count; ++k) {
    const double variance = cov_all(2 * k, 2 * k) + cov_all(2 * k + 1, 2 * k + 1);
    if (fit.height[static_cast<std::size_t>(k)] > kDark * brightest &&
        ((patch.feigned >> k) & 1) == 0 && variance < 2 * kVagueSd * kVagueSd) {
      keep.push_back(k);
    }
  }
  if (keep.empty()) return;
  GroupMatrix information = marginal(measured, {keep.data(), keep.size()});
  const GroupMatrix cov =
      keep.size() == static_cast<std::size_t>(n / 2) ? cov_all : marginals(information);
  OverlappingLeds group;
  group.first = static_cast<int>(out.seen.size());
  group.count = static_cast<int>(keep.size());
  for (std::size_t m = 0; m < keep.size(); ++m) {
    const auto at = static_cast<Eigen::Index>(2 * m);
    const int led = patch.members[static_cast<std::size_t>(keep[m])];
    LedObservation o;
    o.leds = static_cast<std::uint16_t>(1u << led);
    o.uv = fit.uv[static_cast<std::size_t>(keep[m])];
    o.cov = cov.block<2, 2>(at, at) +
            config_.sd_floor_px * config_.sd_floor_px * Matrix2::Identity();
    const int j = match.blob[static_cast<std::size_t>(led)];
    if (j >= 0) o.depth_m = blobs[static_cast<std::size_t>(j)].depth_m;
    out.seen.push_back(o);
  }
  if (group.count < 2) return;
  group.information = information;
  out.groups.push_back(group);
}

}  // namespace alight
