#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/geometry/image.h"

namespace alight {

/// A picture that owns its pixels, rows without padding.
struct Image {
  int width = 0;
  int height = 0;
  int channels = 3;  ///< 1 grey, 3 interleaved blue, green, red
  std::vector<std::uint8_t> data;

  Image() = default;
  Image(int width_px, int height_px, int channel_count, std::uint8_t value = 0);

  bool empty() const { return data.empty(); }
  ImageView view() const;
  std::uint8_t* row(int v) {
    return data.data() + static_cast<std::ptrdiff_t>(v) * width * channels;
  }
};

/// Owns what DepthView shows.
struct DepthImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint16_t> data;  ///< mm, 0 unknown

  bool empty() const { return data.empty(); }
  DepthView view() const;
};

enum class Channels { as_stored, grey, color };

/// PNG, JPEG and whatever else OpenCV reads; 8 bits. Transparency is dropped.
/// io: missing, unreadable; invalid_input: not a picture, 16 bits.
Result<Image> load_image(const std::string& path, Channels channels = Channels::color);

/// 16-bit single-channel PNG, mm.
Result<DepthImage> load_depth(const std::string& path);

/// Complete or not at all.
Result<void> save_png(const std::string& path, const ImageView& image);
Result<void> save_png(const std::string& path, const DepthView& depth);
/// @pre quality in [1, 100]
Result<void> save_jpeg(const std::string& path, const ImageView& image, int quality);

/// As interpolate_colors. @pre one channel
Image demosaiced(const Image& raw, Mosaic mosaic);

/// A copy that owns its pixels.
Image copy_of(const ImageView& image, Channels channels = Channels::as_stored);

}  // namespace alight
