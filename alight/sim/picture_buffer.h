#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "alight/geometry/image.h"

namespace alight {

/// A picture that owns its pixels, `kChannels` values each. It may be a window on a
/// longer line of pixels: the next picture is another window of it, and only what was
/// drawn over has to be put back.
template <class T, std::size_t kChannels>
class PictureBuffer {
 public:
  using Line = std::vector<T>;

  /// Values of all pixels, row after row.
  struct Pixels : std::span<const T> {
    using std::span<const T>::span;
    friend bool operator==(const Pixels& a, const Pixels& b) {
      return std::ranges::equal(a, b);
    }
  };

  int width = 0;
  int height = 0;

  Pixels pixels() const { return {values_.data() + first_, size()}; }

  /// All values become 0.
  void clear(int new_width, int new_height) {
    resize(new_width, new_height);
    line_.reset();
    written_.clear();
    first_ = 0;
    values_.assign(size(), 0);
  }

  /// The pixels of `line` from its `first` on. @pre as many as the picture has.
  void lay(const std::shared_ptr<const Line>& line, std::size_t first, int new_width,
           int new_height) {
    if (line != line_) {
      values_ = *line;
      line_ = line;
    } else if (all_written_) {
      std::copy_n(line->data() + first_, size(), values_.data() + first_);
    } else {
      for (const Piece& piece : written_) {
        std::copy_n(line->data() + piece.first, piece.count,
                    values_.data() + piece.first);
      }
    }
    written_.clear();
    all_written_ = false;
    resize(new_width, new_height);
    first_ = first * kChannels;
  }

  /// The values of `count` pixels from (u, v) on, to be drawn over.
  /// @pre they lie in one row of the picture.
  T* write(int u, int v, int count) {
    const std::size_t at = first_ + static_cast<std::size_t>(v * width + u) * kChannels;
    if (!all_written_) {
      written_.push_back({at, static_cast<std::size_t>(count) * kChannels});
    }
    return values_.data() + at;
  }

  /// The values of all pixels, to be drawn over.
  std::span<T> write_all() {
    all_written_ = true;
    return {values_.data() + first_, size()};
  }

 private:
  struct Piece {
    std::size_t first, count;
  };
  std::size_t size() const {
    return static_cast<std::size_t>(width * height) * kChannels;
  }
  void resize(int new_width, int new_height) {
    width = new_width;
    height = new_height;
  }

  std::shared_ptr<const Line> line_;  // null: black
  std::vector<T> values_;             // the line, drawn over
  std::size_t first_ = 0;
  std::vector<Piece> written_;
  bool all_written_ = false;  // `written_` does not matter then
};

/// A colour picture: interleaved blue, green, red.
struct ColorBuffer : PictureBuffer<std::uint8_t, 3> {
  ImageView view() const {
    return {pixels().data(), width, height, 3, static_cast<std::ptrdiff_t>(width) * 3};
  }
};

/// A depth picture, mm along the optical axis, 0 is unknown.
struct DepthBuffer : PictureBuffer<std::uint16_t, 1> {
  DepthView view() const { return {pixels().data(), width, height, width}; }
};

}  // namespace alight
