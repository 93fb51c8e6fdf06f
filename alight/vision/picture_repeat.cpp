#include "alight/vision/picture_repeat.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

namespace alight {
namespace {

constexpr int kRows = 120;      // every so many are compared,
constexpr int kRowsUnseen = 3;  // and so many where no LED is known: one is as high
constexpr double kAroundPx = 4;

// FNV-1a over whole words, four at a time, for each waits for the one before it.
std::uint64_t fingerprint(const ImageView& picture, const Roi& roi, int step) {
  std::array<std::uint64_t, 4> lanes;
  lanes.fill(1469598103934665603u);
  const auto begin = static_cast<std::size_t>(roi.u0 * picture.channels);
  const auto end = static_cast<std::size_t>(roi.u1 * picture.channels);
  std::array<std::uint64_t, 4> words;
  const auto mix = [&] {
    for (std::size_t k = 0; k < 4; ++k) {
      lanes[k] = (lanes[k] ^ words[k]) * 1099511628211u;
    }
  };
  for (int v = roi.v0; v < roi.v1; v += step) {
    const std::uint8_t* row = picture.row(v);
    std::size_t at = begin;
    // As long as the size is a constant, a copy is a load.
    for (; at + sizeof(words) <= end; at += sizeof(words)) {
      std::memcpy(words.data(), row + at, sizeof(words));
      mix();
    }
    if (at >= end) continue;
    words.fill(0);
    std::memcpy(words.data(), row + at, end - at);
    mix();
  }
  std::uint64_t hash = 0;
  for (const std::uint64_t lane : lanes) hash = (hash ^ lane) * 1099511628211u;
  return hash;
}

}  // namespace

std::uint64_t PictureRepeat::there(const ImageView& picture) const {
  std::uint64_t hash = 0;
  for (const Roi& place : places_) {
    hash = (hash ^ fingerprint(picture, place, step_)) * 1099511628211u;
  }
  return hash;
}

int PictureRepeat::look(const ImageView& picture) {
  const std::uint64_t rows =
      fingerprint(picture, {0, 0, picture.width, picture.height}, kRows);
  const bool same = alike_ > 0 && rows == rows_ && there(picture) == there_;
  alike_ = same ? alike_ + 1 : 1;
  rows_ = rows;
  return alike_;
}

void PictureRepeat::found(const ImageView& picture, std::span<const Vector2> leds_px) {
  if (alike_ > 1) return;  // as before
  places_.clear();
  step_ = leds_px.empty() ? kRowsUnseen : 1;
  if (leds_px.empty()) places_.push_back({0, 0, picture.width, picture.height});
  const auto inside = [](double px, int size) {
    return static_cast<int>(std::clamp(px, 0.0, static_cast<double>(size)));
  };
  for (const Vector2& uv : leds_px) {
    (void)places_.push_back({inside(uv.x() - kAroundPx, picture.width),
                             inside(uv.y() - kAroundPx, picture.height),
                             inside(uv.x() + kAroundPx + 1, picture.width),
                             inside(uv.y() + kAroundPx + 1, picture.height)});
  }
  there_ = there(picture);
}

}  // namespace alight
