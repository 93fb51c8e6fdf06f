#include "alight/vision/linear_picture.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include "alight/geometry/rig.h"

namespace alight {
namespace {

constexpr int kChannelsMost = 3;
// Noise is told of at this grey level at least: of darker ones the slope is none.
constexpr double kNoiseAtLeast = 4;
constexpr double kRoundingVariance = 1.0 / 12;

}  // namespace

LinearPicture::LinearPicture(int width, int height, double gamma)
    : width_(width),
      height_(height),
      pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
              kChannelsMost) {
  set_gamma(gamma);
}

void LinearPicture::set_gamma(double gamma) {
  assert(gamma >= Rig::kGammaLeast && gamma <= Rig::kGammaMost);
  gamma_ = gamma;
  light_ = light_of_stored(gamma);
}

ImageView LinearPicture::of(const ImageView& picture) {
  return of(picture, {0, 0, picture.width, picture.height});
}

ImageView LinearPicture::of(const ImageView& picture, const Roi& box) {
  if (gamma_ == 1) return picture;
  assert(picture.width == width_ && picture.height == height_);
  // Rows have room for colours and `written_` counts bytes: what a picture of other
  // channels has left is found as well.
  ImageView out = picture;
  out.data = pixels_.data();
  out.stride = static_cast<std::ptrdiff_t>(width_) * kChannelsMost;
  const auto row = [&](int v) { return pixels_.data() + v * out.stride; };
  for (int v = written_.v0; v < written_.v1; ++v) {
    std::fill(row(v) + written_.u0, row(v) + written_.u1, std::uint8_t{0});
  }
  const int bytes = width_ * picture.channels;
  written_ = {
      std::clamp(box.u0 * picture.channels, 0, bytes), std::clamp(box.v0, 0, height_),
      std::clamp(box.u1 * picture.channels, 0, bytes), std::clamp(box.v1, 0, height_)};
  if (written_.empty()) written_ = {};
  for (int v = written_.v0; v < written_.v1; ++v) {
    const std::uint8_t* from = picture.row(v);
    std::transform(from + written_.u0, from + written_.u1, row(v) + written_.u0,
                   [&](std::uint8_t value) { return light_[value]; });
  }
  return out;
}

PictureNoise LinearPicture::of(const PictureNoise& noise) const {
  if (gamma_ == 1) return noise;
  const double at = std::max<double>(noise.dark, kNoiseAtLeast) / 255;
  const double slope = gamma_ * std::pow(at, gamma_ - 1);
  PictureNoise out;
  out.dark = light_[static_cast<std::size_t>(std::clamp(noise.dark, 0, 255))];
  out.grey_sd =
      std::sqrt(slope * slope * noise.grey_sd * noise.grey_sd + kRoundingVariance);
  out.luminance_variance = slope * slope * noise.luminance_variance + kRoundingVariance;
  return out;
}

}  // namespace alight
