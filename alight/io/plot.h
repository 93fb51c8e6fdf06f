#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/io/image_io.h"

namespace alight {

struct Rgb {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
};

/// Readable side by side, also by the colour-blind (Okabe and Ito 2008).
namespace palette {
inline constexpr Rgb blue{0, 114, 178};
inline constexpr Rgb orange{213, 94, 0};
inline constexpr Rgb green{0, 158, 115};
inline constexpr Rgb purple{170, 80, 140};
inline constexpr Rgb sky{86, 180, 233};
inline constexpr Rgb amber{230, 159, 0};
inline constexpr Rgb grey{130, 130, 130};
inline constexpr Rgb black{20, 20, 20};
inline constexpr Rgb white{255, 255, 255};
}  // namespace palette

enum class Mark { line, dashed, dots, filled };

/// Points in data units; NaN breaks a line.
struct Series {
  std::vector<double> x = {};
  std::vector<double> y = {};
  std::string label = {};  ///< Empty: not in the legend.
  Rgb color = palette::blue;
  Mark mark = Mark::line;  ///< `filled` closes the outline and fills it.
  double width_px = 2;     ///< Line width or diameter of dots.
  bool in_range =
      true;  ///< The axes stretch to show it; false: cut off where they end.
};

/// A word beside a point of the data, with a dot on it.
struct Note {
  double x = 0;
  double y = 0;
  std::string text = {};
  Rgb color = palette::black;
};

/// One pair of axes.
struct Panel {
  std::string title = {};
  std::string x_label = {};
  std::string y_label = {};
  std::vector<Series> series = {};
  std::vector<Note> notes = {};
  bool equal_aspect = false;  ///< One metre is as long on both axes.
  bool y_from_zero = false;   ///< The y axis begins at 0.
};

struct FigureOptions {
  int columns = 1;
  int panel_width_px = 900;
  int panel_height_px = 420;  ///< Rows with equal aspect: 0.7 to 1.6 of it, as the data
                              ///< needs.
};

/// The panels, row by row, on white.
Image draw_figure(const std::vector<Panel>& panels, const FigureOptions& options = {});
Result<void> save_figure(const std::string& path, const std::vector<Panel>& panels,
                         const FigureOptions& options = {});

/// Annotations over a colour picture; coordinates in px, with fractions.
void draw_circle(Image& image, double u, double v, double radius_px, Rgb color,
                 double width_px = 1.5);
void draw_cross(Image& image, double u, double v, double size_px, Rgb color);
void draw_segment(Image& image, double u0, double v0, double u1, double v1, Rgb color,
                  double width_px = 1.5);
/// With a dark rim, so that it reads on any picture. (u, v) is the left end of the base
/// line.
void draw_text(Image& image, double u, double v, const std::string& text, Rgb color,
               double height_px = 12);

/// A part of a picture, enlarged by a whole number.
Image enlarged(const ImageView& image, const Roi& part, int factor);

}  // namespace alight
