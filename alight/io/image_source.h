#pragma once
#include <memory>
#include <string>

#include "alight/base/result.h"
#include "alight/base/time.h"
#include "alight/geometry/rig.h"
#include "alight/io/image_io.h"

namespace alight {

/// One picture of a source, with its pixels.
struct SourceFrame {
  Time t = 0;        ///< Mid-exposure, ns.
  std::string name;  ///< File, or "VIDEO frame N".
  Image color;
  DepthImage depth;  ///< Empty when there is none.
};

/// Pictures in order of time (CONTRACT: SOURCE): a folder with `frames.csv`, a plain
/// folder of pictures in the order of their names (frame2 before frame10) at the rig's
/// rate, or a video. Of a rig with a mosaic, pictures of one channel are the sensor's
/// own and become colours.
class ImageSource {
 public:
  /// Checks the list (columns, numbers, order of time, files there) before the first
  /// picture is read. io or invalid_input, naming file and line.
  static Result<ImageSource> open(const std::string& path, const Rig& rig);

  /// Reads the next picture into `frame`; false at the end. invalid_input when the size
  /// is not the rig's.
  Result<bool> next(SourceFrame& frame);

  /// Number of pictures; 0 when a video does not say.
  int count() const;

  ImageSource(ImageSource&&) noexcept;
  ImageSource& operator=(ImageSource&&) noexcept;
  ~ImageSource();

 private:
  struct State;
  explicit ImageSource(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace alight
