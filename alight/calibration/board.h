#pragma once
#include <optional>
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/geometry/image.h"
#include "alight/geometry/so3.h"

namespace alight {

/// A flat board with a pattern of known size.
struct BoardSpec {
  enum class Kind { chessboard, charuco };
  Kind kind = Kind::chessboard;
  int columns = 9;  ///< chessboard: inner corners; charuco: squares.
  int rows = 6;
  double square_m = 0.025;
  double marker_share = 0.75;  ///< charuco: side of a marker over that of a square.

  /// invalid_config: sizes out of range; charuco in a build without the library.
  Result<void> validate() const;
};

/// Corners of the board in one picture.
struct BoardView {
  std::vector<Vector3> p_board;  ///< m, z = 0.
  std::vector<Vector2> uv;       ///< px
};

/// The board in a picture, corners to fractions of a pixel; empty when it is not there
/// as a whole (chessboard) or shows fewer than eight corners (charuco).
/// @pre spec.validate()
std::optional<BoardView> find_board(const BoardSpec& spec, const ImageView& image);

}  // namespace alight
