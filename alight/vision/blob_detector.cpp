#include "alight/vision/blob_detector.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "alight/base/median.h"
#include "alight/vision/bright_scan.h"
#include "alight/vision/pixel.h"

namespace alight {
namespace {

// A region's rows lie apart in memory: so many ahead they are asked for.
constexpr int kFetchRows = 8, kCacheLine = 64;

constexpr std::size_t kMaxRuns = 1 << 17;
constexpr std::size_t kMaxParts = 1 << 15;

int grey_at(const ImageView& image, int v, int u) {
  return grey_of(image.row(v) + u * image.channels, image.channels);
}

}  // namespace

Result<void> BlobDetectorConfig::validate() const {
  const auto out = [](const char* name, double value, const char* bounds) {
    std::ostringstream text;
    text << "detector." << name << " is " << value << ", must lie in " << bounds;
    return fail(Fault::invalid_config, text.str());
  };
  if (grey_threshold < 0 || grey_threshold > 254) {
    return out("grey_threshold", grey_threshold, "[0, 254]");
  }
  if (dim_threshold < 0 || dim_threshold > 254) {
    return out("dim_threshold", dim_threshold, "[0, 254]");
  }
  if (!(depth_threshold_m >= 0 && depth_threshold_m <= 65)) {
    return out("depth_threshold_m", depth_threshold_m, "[0, 65]");
  }
  if (!(area_min_px >= 1 && area_min_px <= 1e6)) {
    return out("area_min_px", area_min_px, "[1, 1e6]");
  }
  if (!(area_max_px >= area_min_px && area_max_px <= 1e8)) {
    return out("area_max_px", area_max_px, "[area_min_px, 1e8]");
  }
  if (color_margin_px < 0 || color_margin_px > 20) {
    return out("color_margin_px", color_margin_px, "[0, 20]");
  }
  if (!(color_chroma_min >= 0 && color_chroma_min <= 255)) {
    return out("color_chroma_min", color_chroma_min, "[0, 255]");
  }
  if (!(centroid_sd_min_px > 0 && centroid_sd_min_px <= 10)) {
    return out("centroid_sd_min_px", centroid_sd_min_px, "(0, 10]");
  }
  return {};
}

Result<BlobDetector> BlobDetector::create(const BlobDetectorConfig& config, int width,
                                          int height) {
  if (const auto valid = config.validate(); !valid) return fail(valid.error());
  if (width < 1 || height < 1 || width > 10000 || height > 10000) {
    return fail(Fault::invalid_config, "picture of " + std::to_string(width) + " x " +
                                           std::to_string(height) +
                                           ", each must lie in [1, 10000]");
  }
  return BlobDetector(config, width, height);
}

BlobDetector::BlobDetector(const BlobDetectorConfig& config, int width, int height)
    : config_(config),
      threshold_(config.grey_threshold),
      width_(width),
      height_(height) {
  runs_.reserve(kMaxRuns);
  parts_.reserve(kMaxParts);
  order_.reserve(kMaxParts);
  blobs_.reserve(kMaxBlobs);
  row_begin_.resize(static_cast<std::size_t>(height) + 1);
}

int BlobDetector::root(int part) {
  auto at = static_cast<std::size_t>(part);
  while (parts_[at].parent != static_cast<int>(at)) {
    const auto up = static_cast<std::size_t>(parts_[at].parent);
    parts_[at].parent = parts_[up].parent;
    at = up;
  }
  return static_cast<int>(at);
}

int BlobDetector::join(int a, int b) {
  if (a == b) return a;
  if (b < a) std::swap(a, b);  // The older one stays: order of first pixel.
  Part& to = parts_[static_cast<std::size_t>(a)];
  Part& from = parts_[static_cast<std::size_t>(b)];
  from.parent = a;
  to.u0 = std::min(to.u0, from.u0);
  to.v0 = std::min(to.v0, from.v0);
  to.u1 = std::max(to.u1, from.u1);
  to.v1 = std::max(to.v1, from.v1);
  to.area += from.area;
  to.peak = std::max(to.peak, from.peak);
  to.w += from.w;
  to.wu += from.wu;
  to.wv += from.wv;
  to.wuu += from.wuu;
  to.wuv += from.wuv;
  to.wvv += from.wvv;
  return a;
}

void BlobDetector::add_run(const ImageView& image, int v, int u0, int u1, int v_first) {
  const int reach = config_.smooth ? 3 : 1;
  int part = -1;
  const auto touch = [&](const Run& run) {
    if (u0 - run.u1 >= reach || run.u0 - u1 >= reach) return;
    const int other = root(run.part);
    part = part < 0 ? other : join(part, other);
  };
  const auto begin_of = [&](int row) {
    return row_begin_[static_cast<std::size_t>(row)];
  };
  if (reach > 1 && runs_.size() > begin_of(v)) touch(runs_.back());
  for (int row = std::max(v - reach, v_first); row < v; ++row) {
    const auto first = runs_.begin() + static_cast<std::ptrdiff_t>(begin_of(row));
    const auto last = runs_.begin() + static_cast<std::ptrdiff_t>(begin_of(row + 1));
    auto it = std::partition_point(
        first, last, [&](const Run& run) { return u0 - run.u1 >= reach; });
    for (; it != last && it->u0 - u1 < reach; ++it) touch(*it);
  }
  if (part < 0) {
    part = static_cast<int>(parts_.size());
    parts_.push_back({part, u0, v, u1, v + 1, 0, 0, 0, 0, 0, 0, 0, 0});
  }
  runs_.push_back({u0, u1, part});

  Part& sums = parts_[static_cast<std::size_t>(part)];
  sums.u0 = std::min(sums.u0, u0);
  sums.u1 = std::max(sums.u1, u1);
  sums.v1 = std::max(sums.v1, v + 1);
  sums.area += u1 - u0;
  std::int64_t w = 0, wu = 0, wuu = 0;
  for (int u = u0; u < u1; ++u) {
    const int grey = grey_at(image, v, u);
    const std::int64_t here = grey - threshold_;
    sums.peak = std::max(sums.peak, grey);
    w += here;
    wu += here * u;
    wuu += here * u * u;
  }
  sums.w += w;
  sums.wu += wu;
  sums.wv += w * v;
  sums.wuu += wuu;
  sums.wuv += wu * v;
  sums.wvv += w * v * v;
}

bool BlobDetector::takes(const ImageView& image, const DepthView& depth) const {
  const bool fits =
      depth.empty() ||
      (depth.width == width_ && depth.height == height_ && depth.stride >= width_);
  return fits && !image.empty() && image.width == width_ && image.height == height_ &&
         (image.channels == 1 || image.channels == 3) &&
         image.stride >= static_cast<std::ptrdiff_t>(width_) * image.channels;
}

Result<BlobSpan> BlobDetector::detect(const ImageView& image, const DepthView& depth,
                                      const Roi& roi, LookFor what) {
  if (!takes(image, depth)) return fail(Fault::invalid_input);
  threshold_ = what == LookFor::bright
                   ? config_.grey_threshold
                   : std::min(config_.dim_threshold, config_.grey_threshold);
  threshold_ = std::min(std::max(threshold_, noise_.threshold()), 254);
  Roi cut = roi.empty() ? Roi{0, 0, width_, height_} : roi;
  cut = {std::max(cut.u0, 0), std::max(cut.v0, 0), std::min(cut.u1, width_),
         std::min(cut.v1, height_)};
  runs_.clear();
  parts_.clear();
  order_.clear();
  blobs_.clear();
  if (cut.empty()) return BlobSpan(blobs_);

  const int tau = threshold_;
  const int c = image.channels;
  const bool masked = !depth.empty() && config_.depth_threshold_m > 0;
  const int far_mm = static_cast<int>(std::lround(config_.depth_threshold_m * 1000));
  // Whole rows follow one another: memory is read ahead of itself.
  const bool apart = (cut.u1 - cut.u0) * c < image.stride;
  for (int v = cut.v0; v < cut.v1; ++v) {
    row_begin_[static_cast<std::size_t>(v)] = runs_.size();
    const std::uint8_t* bytes = image.row(v);
    if (apart && v + kFetchRows < cut.v1) {
      const std::uint8_t* next = image.row(v + kFetchRows);
      for (int at = cut.u0 * c; at < cut.u1 * c; at += kCacheLine) {
        __builtin_prefetch(next + at);
      }
    }
    const std::uint16_t* mm = masked ? depth.row(v) : nullptr;
    const auto lit = [&](int u) {
      return grey_at(image, v, u) > tau && (mm == nullptr || mm[u] < far_mm);
    };
    int at = cut.u0 * c;
    while ((at = first_bright(bytes, at, cut.u1 * c, tau)) < cut.u1 * c) {
      const int u0 = at / c;
      int u1 = u0;
      while (u1 < cut.u1 && lit(u1)) ++u1;
      if (u1 > u0) {
        if (runs_.size() == kMaxRuns || parts_.size() == kMaxParts) {
          return fail(Fault::degenerate);
        }
        add_run(image, v, u0, u1, cut.v0);
      }
      at = std::max(u1, u0 + 1) * c;
    }
    row_begin_[static_cast<std::size_t>(v) + 1] = runs_.size();
  }

  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    if (part.parent == static_cast<int>(i) && part.area >= config_.area_min_px &&
        part.area <= config_.area_max_px) {
      order_.push_back(static_cast<int>(i));
    }
  }
  if (order_.size() > kMaxBlobs) {
    const auto larger = [&](int a, int b) {
      const auto w_a = parts_[static_cast<std::size_t>(a)].w;
      const auto w_b = parts_[static_cast<std::size_t>(b)].w;
      return w_a != w_b ? w_a > w_b : a < b;
    };
    std::nth_element(order_.begin(), order_.begin() + kMaxBlobs, order_.end(), larger);
    order_.resize(kMaxBlobs);
    std::sort(order_.begin(), order_.end());
  }
  for (const int i : order_) {
    Blob blob = finish(parts_[static_cast<std::size_t>(i)], image, depth);
    const Roi& box = blob.box;
    blob.cut =
        box.u0 <= cut.u0 || box.v0 <= cut.v0 || box.u1 >= cut.u1 || box.v1 >= cut.v1;
    blobs_.push_back(blob);
  }
  return BlobSpan(blobs_);
}

Blob BlobDetector::finish(const Part& part, const ImageView& image,
                          const DepthView& depth) const {
  Blob blob;
  const auto w = static_cast<double>(part.w);
  // Second moments about the corner of the box, in whole numbers: nothing cancels.
  const std::int64_t u0 = part.u0, v0 = part.v0;
  const auto du = static_cast<double>(part.wu - part.w * u0) / w;
  const auto dv = static_cast<double>(part.wv - part.w * v0) / w;
  blob.uv = Vector2(static_cast<double>(u0) + du, static_cast<double>(v0) + dv);
  const auto uu =
      static_cast<double>(part.wuu - 2 * u0 * part.wu + u0 * u0 * part.w) / w;
  const auto vv =
      static_cast<double>(part.wvv - 2 * v0 * part.wv + v0 * v0 * part.w) / w;
  const auto uv =
      static_cast<double>(part.wuv - u0 * part.wv - v0 * part.wu + u0 * v0 * part.w) /
      w;
  blob.spread << uu - du * du, uv - du * dv, uv - du * dv, vv - dv * dv;
  blob.area_px = part.area;
  blob.brightness = w;
  blob.peak = part.peak;
  blob.saturated = part.peak >= 250;
  blob.box = {part.u0, part.v0, part.u1, part.v1};

  // Pixel noise n moves the centroid by n sqrt(area * spread) / w; a patch of few
  // pixels is besides rounded to the grid, which a larger one averages out.
  const double noise2 =
      std::max(4.0, noise_.grey_sd * noise_.grey_sd) + 0.1 * w / part.area;
  const double floor2 = config_.centroid_sd_min_px * config_.centroid_sd_min_px;
  const double grid2 = 1.0 / 12 / std::pow(part.area, 1.5);
  const Matrix2 shape = blob.spread + Matrix2::Identity() / 12;
  blob.cov =
      (floor2 + grid2) * Matrix2::Identity() + noise2 * part.area / (w * w) * shape;

  const int m = config_.color_margin_px;
  blob.color =
      color_at(image, {std::max(part.u0 - m, 0), std::max(part.v0 - m, 0),
                       std::min(part.u1 + m, width_), std::min(part.v1 + m, height_)});
  if (!depth.empty()) blob.depth_m = depth_of(part, image, depth);
  return blob;
}

LedColor BlobDetector::color_at(const ImageView& image, const Roi& box) const {
  if (image.channels != 3) return LedColor::none;
  const auto [u0, v0, u1, v1] = box;
  const int step_u = 1 + (u1 - u0) / 64, step_v = 1 + (v1 - v0) / 64;
  // The darkest pixels carry the sensor's own tint.
  const int dark = std::max(std::min(30, threshold_), noise_.threshold());
  std::int64_t total = 0, b = 0, g = 0, r = 0;
  for (int v = v0; v < v1; v += step_v) {
    for (int u = u0; u < u1; u += step_u) {
      const std::uint8_t* p = image.row(v) + 3 * u;
      const int least = std::min<int>(std::min<int>(p[0], p[1]), p[2]);
      const int w = grey_of(p, 3) < dark ? 0 : 255 - least;
      total += w;
      b += w * p[0];
      g += w * p[1];
      r += w * p[2];
    }
  }
  if (total == 0) return LedColor::none;
  const auto most = std::max({b, g, r}), least = std::min({b, g, r});
  const auto chroma = static_cast<double>(most - least);
  if (chroma < config_.color_chroma_min * static_cast<double>(total)) {
    return LedColor::white;
  }
  double degrees = 0;
  if (most == r) {
    degrees = 60 * static_cast<double>(g - b) / chroma;
  } else if (most == g) {
    degrees = 120 + 60 * static_cast<double>(b - r) / chroma;
  } else {
    degrees = 240 + 60 * static_cast<double>(r - g) / chroma;
  }
  if (degrees > -35 && degrees < 35) return LedColor::red;
  if (degrees > 75 && degrees < 185) return LedColor::green;
  if (degrees > 195 && degrees < 275) return LedColor::blue;
  return LedColor::white;
}

double BlobDetector::depth_of(const Part& part, const ImageView& image,
                              const DepthView& depth) const {
  // Median, so that a background seen past the edge of a small body does not pull.
  std::array<std::uint16_t, 256> known;
  std::size_t count = 0;
  for (int v = part.v0; v < part.v1; ++v) {
    for (int u = part.u0; u < part.u1 && count < known.size(); ++u) {
      const std::uint16_t mm = depth.row(v)[u];
      if (mm != 0 && grey_at(image, v, u) > threshold_) known[count++] = mm;
    }
  }
  if (count == 0) return 0;
  return median(known.begin(), known.begin() + static_cast<std::ptrdiff_t>(count)) /
         1000.0;
}

}  // namespace alight
