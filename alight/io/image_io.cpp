#include "alight/io/image_io.h"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string_view>

#include "alight/io/files.h"
#include "alight/io/held_standard_error.h"

namespace alight {
namespace {

/// Whether a file that begins as one of these ends as it should: half a picture is
/// decoded as one, the rest black.
bool is_cut(std::string_view bytes) {
  if (bytes.substr(0, 4) == "\x89PNG") {
    return bytes.substr(bytes.size() - std::min<std::size_t>(bytes.size(), 64))
               .find("IEND") == std::string_view::npos;
  }
  if (bytes.substr(0, 2) != "\xFF\xD8") return false;
  // The end is that of the picture, not of a thumbnail in one of its segments.
  const auto at = [&](std::size_t i) { return static_cast<unsigned char>(bytes[i]); };
  std::size_t i = 2;
  while (i + 4 <= bytes.size() && at(i) == 0xFF && at(i + 1) != 0xDA) {
    i += 2 + (std::size_t{at(i + 2)} << 8) + at(i + 3);
  }
  return i >= bytes.size() || bytes.find("\xFF\xD9", i) == std::string_view::npos;
}

Result<cv::Mat> decode(const std::string& path) {
  const auto bytes = read_file(path);
  if (!bytes) return fail(bytes.error());
  cv::Mat picture;
  if (!bytes->empty() && !is_cut(*bytes)) {
    const cv::Mat raw(1, static_cast<int>(bytes->size()), CV_8U,
                      const_cast<char*>(bytes->data()));
    // OpenCV throws on some damaged headers and returns nothing on others.
    HeldStandardError held;
    try {
      picture = cv::imdecode(raw, cv::IMREAD_UNCHANGED);
    } catch (const cv::Exception&) {
      picture.release();
    }
    // A damaged JPEG is decoded with a word of warning, a PNG after an error; what
    // libpng warns of otherwise (colour profiles) is harmless.
    const std::string said = held.said();
    if (said.find("JPEG") != std::string::npos ||
        said.find("libpng error") != std::string::npos) {
      picture.release();
    }
  }
  if (picture.empty()) {
    return fail(Fault::invalid_input,
                path + ": is not a picture that can be read (PNG, JPEG, BMP, TIFF)");
  }
  return picture;
}

/// As the ending `kind` says, with OpenCV's parameters for it.
Result<void> save(const std::string& path, const cv::Mat& picture,
                  const std::string& kind = ".png",
                  const std::vector<int>& parameters = {}) {
  std::vector<std::uint8_t> bytes;
  if (picture.empty() || !cv::imencode(kind, picture, bytes, parameters)) {
    return fail(Fault::io, path + ": the picture cannot be made a " + kind);
  }
  return write_file(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

Image from_mat(const cv::Mat& mat) {
  Image image(mat.cols, mat.rows, mat.channels());
  const auto row_bytes = static_cast<std::size_t>(mat.cols * mat.channels());
  for (int v = 0; v < mat.rows; ++v) std::memcpy(image.row(v), mat.ptr(v), row_bytes);
  return image;
}

cv::Mat as_mat(const ImageView& image) {
  return cv::Mat(image.height, image.width, CV_8UC(image.channels),
                 const_cast<std::uint8_t*>(image.data),
                 static_cast<std::size_t>(image.stride));
}

cv::Mat converted(const cv::Mat& mat, Channels channels) {
  cv::Mat result = mat;
  if (mat.channels() == 4) cv::cvtColor(mat, result, cv::COLOR_BGRA2BGR);
  if (channels == Channels::color && result.channels() == 1) {
    cv::cvtColor(result, result, cv::COLOR_GRAY2BGR);
  } else if (channels == Channels::grey && result.channels() == 3) {
    cv::cvtColor(result, result, cv::COLOR_BGR2GRAY);
  }
  return result;
}

}  // namespace

Image::Image(int width_px, int height_px, int channel_count, std::uint8_t value)
    : width(width_px),
      height(height_px),
      channels(channel_count),
      data(static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px) *
               static_cast<std::size_t>(channel_count),
           value) {}

ImageView Image::view() const {
  if (empty()) return {};
  return {data.data(), width, height, channels, std::ptrdiff_t{width} * channels};
}

DepthView DepthImage::view() const {
  if (empty()) return {};
  return {data.data(), width, height, width};
}

Result<Image> load_image(const std::string& path, Channels channels) {
  const auto picture = decode(path);
  if (!picture) return fail(picture.error());
  if (picture->depth() != CV_8U) {
    return fail(Fault::invalid_input,
                path + ": has more than 8 bits a channel, a camera picture has 8");
  }
  if (picture->channels() == 2) {
    return fail(Fault::invalid_input, path + ": has 2 channels, needed are 1 or 3");
  }
  return from_mat(converted(*picture, channels));
}

Result<DepthImage> load_depth(const std::string& path) {
  const auto picture = decode(path);
  if (!picture) return fail(picture.error());
  if (picture->type() != CV_16UC1) {
    return fail(Fault::invalid_input,
                path + ": is not a depth picture (one channel of 16 bits, in mm)");
  }
  DepthImage depth;
  depth.width = picture->cols;
  depth.height = picture->rows;
  for (int v = 0; v < depth.height; ++v) {
    const auto* row = picture->ptr<std::uint16_t>(v);
    depth.data.insert(depth.data.end(), row, row + depth.width);
  }
  return depth;
}

Result<void> save_png(const std::string& path, const ImageView& image) {
  if (image.empty()) return fail(Fault::io, path + ": the picture is empty");
  return save(path, as_mat(image));
}

Result<void> save_png(const std::string& path, const DepthView& depth) {
  if (depth.empty()) return fail(Fault::io, path + ": the picture is empty");
  return save(path, cv::Mat(depth.height, depth.width, CV_16UC1,
                            const_cast<std::uint16_t*>(depth.data),
                            static_cast<std::size_t>(depth.stride) * 2));
}

Result<void> save_jpeg(const std::string& path, const ImageView& image, int quality) {
  if (image.empty()) return fail(Fault::io, path + ": the picture is empty");
  return save(path, as_mat(image), ".jpg", {cv::IMWRITE_JPEG_QUALITY, quality});
}

Image demosaiced(const Image& raw, Mosaic mosaic) {
  assert(raw.channels == 1);
  Image color(raw.width, raw.height, 3);
  interpolate_colors(raw.data.data(), raw.width, raw.height, mosaic, color.data.data());
  return color;
}

Image copy_of(const ImageView& image, Channels channels) {
  assert(!image.empty());
  return from_mat(converted(as_mat(image), channels));
}

}  // namespace alight
