#include "alight/vision/lights_fitted.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace alight {
namespace {

constexpr double kAreaMost_px = 100;
constexpr int kFitsMost = 200;        // in one picture
constexpr double kForeignReach = 20;  // px; farther patches have no pixels in a fit
// Stretch of two lights; 2 px apart they have 1.
constexpr double kLongLeast_px2 = 0.4;
// chi2 per pixel: good enough, explained at all, and of what is not.
constexpr double kGood = 1, kExplained = 3, kNone = 12;
constexpr double kBetter = 2;        // times less of it that two must leave
constexpr double kNearest_px = 1.3;  // that lights stand to one another
constexpr double kDimmest = 0.25;    // share of the brightest
constexpr double kPlaceSd_px = 0.4;  // of a light that is worth telling
constexpr double kPlaceFloor_px = 0.02;
constexpr double kOuter_px = 0.75;  // to where a light has its own colour

using Sought = FixedVector<LightSought, kMaxGroup>;

double misfit(const std::optional<SpotFit>& fit) {
  return fit ? fit->chi2_per_pixel : kNone;
}

GroupMatrix covariance(const SpotFit& fit) {
  GroupMatrix information = fit.information / std::max(fit.chi2_per_pixel, 1.0);
  information.diagonal().array() += 1e-2;  // 10 px: what the pixels leave open
  GroupMatrix cov =
      Eigen::LLT<GroupMatrix>(information)
          .solve(GroupMatrix::Identity(information.rows(), information.cols()));
  cov.diagonal().array() += kPlaceFloor_px * kPlaceFloor_px;
  return cov;
}

/// Lights each of which stands for itself.
bool sound(const SpotFit& fit) {
  const auto end = fit.height.begin() + fit.count;
  const double brightest = *std::max_element(fit.height.begin(), end);
  const GroupMatrix cov = covariance(fit);
  for (int i = 0; i < fit.count; ++i) {
    const auto n = static_cast<std::size_t>(i);
    if (fit.height[n] < kDimmest * brightest) return false;
    if (cov.diagonal().segment<2>(2 * i).mean() > kPlaceSd_px * kPlaceSd_px) {
      return false;
    }
    for (std::size_t k = 0; k < n; ++k) {
      if ((fit.uv[n] - fit.uv[k]).norm() < kNearest_px) return false;
    }
  }
  return true;
}

/// The lights of one patch.
class Parting {
 public:
  Parting(const ImageView& image, const PointSpread& spread, BlobSpan blobs,
          std::size_t own, int& fits_left)
      : image_(image), spread_(spread), fits_left_(fits_left) {
    for (std::size_t k = 0; k < blobs.size(); ++k) {
      const Vector2 off = blobs[k].uv - blobs[own].uv;
      if (k == own || off.cwiseAbs().maxCoeff() > kForeignReach) continue;
      if (!foreign_.push_back({.box = blobs[k].box})) break;
    }
  }

  std::optional<SpotFit> lights_of(const Blob& blob) const {
    const auto one = fit(Sought{{blob.uv}});
    const Vector2 stretch = stretch_of(blob.spread);
    if (misfit(one) <= kGood || stretch.norm() < kLongLeast_px2) return one;
    const double way = std::atan2(stretch.y(), stretch.x()) / 2;
    const Vector2 half =
        std::sqrt(stretch.norm()) * Vector2(std::cos(way), std::sin(way));
    const auto two = fit(Sought{{blob.uv + half}, {blob.uv - half}});
    return two && is_better(*two, one) && sound(*two) ? two : one;
  }

 private:
  std::optional<SpotFit> fit(const Sought& sought) const {
    if (fits_left_ <= 0) return std::nullopt;
    --fits_left_;
    return fit_spots(image_, {sought.data(), sought.size()}, spread_, Vector2::Zero(),
                     {foreign_.data(), foreign_.size()});
  }

  static bool is_better(const SpotFit& two, const std::optional<SpotFit>& one) {
    return kBetter * std::max(two.chi2_per_pixel, kGood) <= misfit(one);
  }

  const ImageView& image_;
  const PointSpread& spread_;
  int& fits_left_;
  FixedVector<ForeignLight, 32> foreign_;
};

/// The `i`-th light of a patch that is several.
Blob part_of(const Blob& whole, const SpotFit& fit, std::size_t i,
             const ImageView& image, const BlobDetector& detector) {
  Vector2 middle = Vector2::Zero();
  double height = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(fit.count); ++k) {
    middle += fit.uv[k] / fit.count;
    height += fit.height[k];
  }
  const double share = fit.height[i] / height;
  Blob part = whole;
  part.uv = fit.uv[i];
  part.spread = fit.variance_px2 * Matrix2::Identity();
  part.area_px = std::max(1.0, share * whole.area_px);
  part.brightness = share * whole.brightness;
  part.peak = std::min(fit.height[i], 255.0);
  // On the side of the others it has their colour, too.
  const Vector2 outer = part.uv + kOuter_px * (part.uv - middle).normalized();
  const int u = static_cast<int>(std::lround(outer.x()));
  const int v = static_cast<int>(std::lround(outer.y()));
  part.box = {std::max(u - 1, 0), std::max(v - 1, 0), std::min(u + 2, image.width),
              std::min(v + 2, image.height)};
  part.color = detector.color_at(image, part.box);
  return part;
}

}  // namespace

int fit_lights(const ImageView& image, const PointSpread& spread,
               const BlobDetector& detector, FixedVector<Blob, kMaxBlobs>& blobs) {
  const std::size_t count = blobs.size();
  int fits_left = kFitsMost;
  for (std::size_t j = 0; j < count && fits_left > 0; ++j) {
    const Blob whole = blobs[j];
    if (whole.cut || whole.area_px > kAreaMost_px) continue;
    const Parting parting(image, spread, {blobs.data(), count}, j, fits_left);
    const auto fit = parting.lights_of(whole);
    if (!fit) continue;
    const auto lights = static_cast<std::size_t>(fit->count);
    const GroupMatrix cov = covariance(*fit);
    if (lights == 1) {
      const bool tells =
          fit->chi2_per_pixel <= kExplained && cov.trace() < whole.cov.trace();
      if (!tells) continue;
      blobs[j].uv = fit->uv[0];
      blobs[j].cov = cov;
      continue;
    }
    if (blobs.size() + lights - 1 > kMaxBlobs) break;
    for (std::size_t i = 0; i < lights; ++i) {
      Blob part = part_of(whole, *fit, i, image, detector);
      const auto at = static_cast<Eigen::Index>(2 * i);
      part.cov = cov.block<2, 2>(at, at);
      if (i == 0) {
        blobs[j] = part;
      } else {
        blobs.push_back(part);
      }
    }
  }
  return static_cast<int>(blobs.size() - count);
}

}  // namespace alight
