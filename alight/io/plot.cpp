#include "alight/io/plot.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>

namespace alight {
namespace {

// Everything is drawn at twice the size and averaged down: smoother than LINE_AA alone.
constexpr int kOver = 2;
constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr int kShift = 4;              // fraction bits of OpenCV's drawing coordinates
constexpr double kTitle = 13 * kOver;  // height of capitals
constexpr double kLegend = 11 * kOver;
const Rgb kGrid{228, 228, 228};
const Rgb kAxis{90, 90, 90};

cv::Scalar scalar(Rgb c) { return cv::Scalar(c.b, c.g, c.r); }

/// Sub-pixel coordinates, kept far from the overflow of int.
cv::Point fixed(double u, double v) {
  const auto one = [](double x) {
    return static_cast<int>(std::lround(std::clamp(x, -2e4, 2e4) * (1 << kShift)));
  };
  return {one(u), one(v)};
}

int thickness(double width_px) { return std::max(1, static_cast<int>(width_px + 0.5)); }

void stroke(cv::Mat& mat, double u0, double v0, double u1, double v1, Rgb color,
            double width) {
  cv::line(mat, fixed(u0, v0), fixed(u1, v1), scalar(color), thickness(width),
           cv::LINE_AA, kShift);
}

void dot(cv::Mat& mat, double u, double v, double radius, Rgb color) {
  cv::circle(mat, fixed(u, v), static_cast<int>(radius * (1 << kShift)), scalar(color),
             cv::FILLED, cv::LINE_AA, kShift);
}

double text_scale(double height) { return height / 22.0; }  // capitals are 22 px at 1

cv::Size text_size(const std::string& text, double height) {
  int below = 0;
  return cv::getTextSize(text, kFont, text_scale(height), 1, &below);
}

/// (u, v): the base line; `align` 0 starts there, 0.5 centres, 1 ends there.
void put(cv::Mat& mat, double u, double v, const std::string& text, double height,
         Rgb color, double align = 0, int weight = 2) {
  u -= align * text_size(text, height).width;
  cv::putText(mat, text,
              {static_cast<int>(std::lround(u)), static_cast<int>(std::lround(v))},
              kFont, text_scale(height), scalar(color), weight, cv::LINE_AA);
}

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();

  void take(double value) {
    if (!std::isfinite(value)) return;
    low = std::min(low, value);
    high = std::max(high, value);
  }
  double size() const { return high - low; }
  void settle(double padding) {
    if (!(low <= high)) *this = {0, 1};
    const double least = 1e-9 + 1e-6 * std::max(std::abs(low), std::abs(high));
    const double grow = size() > least ? padding * size() : std::max(0.5, least);
    low -= grow;
    high += grow;
  }
  void widen_to(double wanted) {
    const double grow = std::max(0.0, (wanted - size()) / 2);
    low -= grow;
    high += grow;
  }
};

/// 1, 2 or 5 times a power of ten, for about `count` steps over the range.
double tick_step(const Range& range, double count) {
  const double raw = range.size() / std::max(1.0, count);
  const double power = std::pow(10, std::floor(std::log10(raw)));
  for (const double m : {1.0, 2.0, 5.0}) {
    if (raw <= m * power * 1.0001) return m * power;
  }
  return 10 * power;
}

std::string tick_text(double value, double step) {
  const int digits =
      std::clamp(static_cast<int>(std::ceil(-std::log10(step) - 1e-9)), 0, 9);
  if (std::abs(value) < step * 1e-6) value = 0;
  char text[40];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

/// Draws one panel into its part of the sheet.
class Axes {
 public:
  /// @param width Of the sheet to come.
  Axes(const Panel& panel, int width) : panel_(panel), width_(width) {
    for (const Series& series : panel.series) {
      if (!series.in_range) continue;
      for (const double v : series.x) x_.take(v);
      for (const double v : series.y) y_.take(v);
    }
    for (const Note& note : panel.notes) {
      x_.take(note.x);
      y_.take(note.y);
    }
    x_.settle(panel.equal_aspect ? 0.05 : 0.01);
    y_.settle(0.07);
    if (panel.y_from_zero) y_.low = 0;
    legend_below_ = legend_width() + text_size(panel.title, kTitle).width >
                    width - left_ - right_ - 20 * kOver;
    if (legend_below_) top_ += 20 * kOver;
  }

  /// Where one metre is as long on both axes, the height that leaves nothing empty.
  int wanted_height(int usual) const {
    if (!panel_.equal_aspect) return usual;
    const double area = y_.size() / x_.size() * (width_ - left_ - right_);
    return static_cast<int>(
        std::clamp(area + top_ + bottom_, 0.7 * usual, 1.6 * usual));
  }

  void draw(cv::Mat sheet) {
    sheet_ = std::move(sheet);
    area_ = cv::Rect(left_, top_, std::max(1, sheet_.cols - left_ - right_),
                     std::max(1, sheet_.rows - top_ - bottom_));
    if (panel_.equal_aspect) {
      const double metre = std::max(x_.size() / area_.width, y_.size() / area_.height);
      x_.widen_to(metre * area_.width);
      y_.widen_to(metre * area_.height);
    }
    draw_grid();
    cv::Mat inside = sheet_(area_);
    for (const Series& series : panel_.series) draw_series(inside, series);
    stroke(sheet_, left_, area_.br().y, area_.br().x, area_.br().y, kAxis, 2);
    stroke(sheet_, left_, top_, left_, area_.br().y, kAxis, 2);
    for (const Note& note : panel_.notes) draw_note(note);
    draw_head();
  }

 private:
  double u(double x) const { return (x - x_.low) / x_.size() * area_.width; }
  double v(double y) const { return (y_.high - y) / y_.size() * area_.height; }

  void draw_grid() {
    const double sx = tick_step(x_, area_.width / (95.0 * kOver));
    for (double k = std::ceil(x_.low / sx); k * sx <= x_.high; ++k) {
      const double at = left_ + u(k * sx);
      stroke(sheet_, at, top_, at, area_.br().y, kGrid, 2);
      put(sheet_, at, area_.br().y + 17 * kOver, tick_text(k * sx, sx), 10 * kOver,
          kAxis, 0.5);
    }
    const double sy = tick_step(y_, area_.height / (52.0 * kOver));
    for (double k = std::ceil(y_.low / sy); k * sy <= y_.high; ++k) {
      const double at = top_ + v(k * sy);
      stroke(sheet_, left_, at, area_.br().x, at, kGrid, 2);
      put(sheet_, left_ - 7 * kOver, at + 4.5 * kOver, tick_text(k * sy, sy),
          10 * kOver, kAxis, 1);
    }
    put(sheet_, left_ + area_.width / 2.0, sheet_.rows - 9 * kOver, panel_.x_label,
        11 * kOver, kAxis, 0.5);
    draw_y_label();
  }

  void draw_y_label() {
    if (panel_.y_label.empty()) return;
    const cv::Size size = text_size(panel_.y_label, 11 * kOver);
    cv::Mat strip(20 * kOver, size.width + 8, CV_8UC3, cv::Scalar::all(255));
    put(strip, 4, 14 * kOver, panel_.y_label, 11 * kOver, kAxis);
    cv::rotate(strip, strip, cv::ROTATE_90_COUNTERCLOCKWISE);
    const int y0 = std::max(0, top_ + (area_.height - strip.rows) / 2);
    const cv::Rect place(2 * kOver, y0, strip.cols,
                         std::min(strip.rows, sheet_.rows - y0));
    strip(cv::Rect(0, 0, place.width, place.height)).copyTo(sheet_(place));
  }

  int legend_width() const {
    int width = 0;
    for (const Series& series : panel_.series) {
      if (series.label.empty()) continue;
      width += text_size(series.label, kLegend).width + (6 + 20 + 14) * kOver;
    }
    return width;
  }

  /// Title on the left, legend on the right of the line above the axes, or, where both
  /// do not fit, on a line of its own.
  void draw_head() {
    const double line = top_ - 12 * kOver;
    put(sheet_, left_, legend_below_ ? line - 20 * kOver : line, panel_.title, kTitle,
        palette::black, 0, 2);
    double at = area_.br().x;
    if (legend_below_) at = std::min<double>(at, left_ + legend_width());
    for (auto it = panel_.series.rbegin(); it != panel_.series.rend(); ++it) {
      if (it->label.empty()) continue;
      put(sheet_, at, line, it->label, kLegend, palette::black, 1);
      at -= text_size(it->label, kLegend).width + 6 * kOver;
      const double y = line - 4.5 * kOver;
      const double from = at - 20 * kOver;
      switch (it->mark) {
        case Mark::dots:
          dot(sheet_, from + 10 * kOver, y, 2.5 * kOver, it->color);
          break;
        case Mark::dashed:
          stroke(sheet_, from, y, from + 8 * kOver, y, it->color, 2 * kOver);
          stroke(sheet_, from + 12 * kOver, y, at, y, it->color, 2 * kOver);
          break;
        case Mark::filled:
          stroke(sheet_, from + 4 * kOver, y, at - 4 * kOver, y, it->color, 8 * kOver);
          break;
        case Mark::line:
          stroke(sheet_, from, y, at, y, it->color, 2 * kOver);
      }
      at = from - 14 * kOver;
    }
  }

  void draw_series(cv::Mat& mat, const Series& s) {
    const std::size_t n = std::min(s.x.size(), s.y.size());
    std::vector<cv::Point2d> run;
    for (std::size_t i = 0; i <= n; ++i) {
      if (i < n && std::isfinite(s.x[i]) && std::isfinite(s.y[i])) {
        run.emplace_back(u(s.x[i]), v(s.y[i]));
        continue;
      }
      draw_run(mat, s, run);
      run.clear();
    }
  }

  void draw_run(cv::Mat& mat, const Series& s, const std::vector<cv::Point2d>& run) {
    if (run.empty()) return;
    const double width = s.width_px * kOver;
    if (s.mark == Mark::filled) {
      std::vector<cv::Point> outline;
      for (const auto& p : run) outline.push_back(fixed(p.x, p.y));
      cv::fillPoly(mat, std::vector<std::vector<cv::Point>>{outline}, scalar(s.color),
                   cv::LINE_AA, kShift);
    } else if (s.mark == Mark::dots || run.size() == 1) {
      for (const auto& p : run) dot(mat, p.x, p.y, width / 2, s.color);
    } else if (s.mark == Mark::line) {
      for (std::size_t i = 1; i < run.size(); ++i) {
        stroke(mat, run[i - 1].x, run[i - 1].y, run[i].x, run[i].y, s.color, width);
      }
    } else {
      draw_dashed(mat, run, s.color, width);
    }
  }

  void draw_dashed(cv::Mat& mat, const std::vector<cv::Point2d>& run, Rgb color,
                   double width) {
    const double dash = 8 * kOver;
    const double period = 14 * kOver;
    double walked = 0;
    for (std::size_t i = 1; i < run.size(); ++i) {
      const cv::Point2d step = run[i] - run[i - 1];
      const double length = std::min(std::hypot(step.x, step.y), 1e5);
      for (double at = 0; at < length;) {
        const double phase = std::fmod(walked + at, period);
        const double until =
            std::min(length, at + (phase < dash ? dash : period) - phase);
        if (phase < dash) {
          const cv::Point2d a = run[i - 1] + step * (at / length);
          const cv::Point2d b = run[i - 1] + step * (until / length);
          stroke(mat, a.x, a.y, b.x, b.y, color, width);
        }
        at = std::max(until, at + 1e-3);
      }
      walked += length;
    }
  }

  void draw_note(const Note& note) {
    if (!std::isfinite(note.x) || !std::isfinite(note.y)) return;
    const double at_u = left_ + u(note.x);
    const double at_v = top_ + v(note.y);
    dot(sheet_, at_u, at_v, 3.5 * kOver, note.color);
    const int width = text_size(note.text, 11 * kOver).width;
    const bool fits = at_u + 8 * kOver + width < sheet_.cols;
    put(sheet_, at_u + (fits ? 8 : -8) * kOver, at_v - 6 * kOver, note.text, 11 * kOver,
        note.color, fits ? 0 : 1);
  }

  cv::Mat sheet_;
  const Panel& panel_;
  int width_ = 0;
  bool legend_below_ = false;
  int left_ = 68 * kOver;
  int right_ = 20 * kOver;
  int top_ = 38 * kOver;
  int bottom_ = 46 * kOver;
  cv::Rect area_;
  Range x_;
  Range y_;
};

cv::Mat over(Image& image) {
  return cv::Mat(image.height, image.width, CV_8UC(image.channels), image.data.data());
}

}  // namespace

Image draw_figure(const std::vector<Panel>& panels, const FigureOptions& options) {
  const int count = static_cast<int>(panels.size());
  const int columns = std::clamp(options.columns, 1, std::max(1, count));
  const int w = std::max(200, options.panel_width_px) * kOver;
  const int h = std::max(150, options.panel_height_px) * kOver;
  std::vector<Axes> axes;
  axes.reserve(panels.size());
  std::vector<int> heights;
  for (int i = 0; i < count; ++i) {
    axes.emplace_back(panels[static_cast<std::size_t>(i)], w);
    const int wanted = axes.back().wanted_height(h) / kOver * kOver;
    if (i % columns == 0) heights.push_back(wanted);
    heights.back() = std::max(heights.back(), wanted);
  }
  if (heights.empty()) heights.push_back(h);
  const int total = std::accumulate(heights.begin(), heights.end(), 0);
  cv::Mat sheet(total, columns * w, CV_8UC3, cv::Scalar::all(255));
  int top = 0;
  for (int i = 0; i < count; ++i) {
    const int height = heights[static_cast<std::size_t>(i / columns)];
    axes[static_cast<std::size_t>(i)].draw(
        sheet(cv::Rect(i % columns * w, top, w, height)));
    if (i % columns == columns - 1) top += height;
  }
  Image image(columns * w / kOver, total / kOver, 3);
  cv::Mat small = over(image);
  cv::resize(sheet, small, small.size(), 0, 0, cv::INTER_AREA);
  return image;
}

Result<void> save_figure(const std::string& path, const std::vector<Panel>& panels,
                         const FigureOptions& options) {
  return save_png(path, draw_figure(panels, options).view());
}

void draw_circle(Image& image, double u, double v, double radius_px, Rgb color,
                 double width_px) {
  cv::Mat mat = over(image);
  cv::circle(mat, fixed(u, v), static_cast<int>(radius_px * (1 << kShift)),
             scalar(color), thickness(width_px), cv::LINE_AA, kShift);
}

void draw_cross(Image& image, double u, double v, double size_px, Rgb color) {
  const double r = size_px / 2;
  draw_segment(image, u - r, v, u + r, v, color, 1);
  draw_segment(image, u, v - r, u, v + r, color, 1);
}

void draw_segment(Image& image, double u0, double v0, double u1, double v1, Rgb color,
                  double width_px) {
  cv::Mat mat = over(image);
  stroke(mat, u0, v0, u1, v1, color, width_px);
}

void draw_text(Image& image, double u, double v, const std::string& text, Rgb color,
               double height_px) {
  cv::Mat mat = over(image);
  put(mat, u, v, text, height_px, palette::black, 0, 3);
  put(mat, u, v, text, height_px, color, 0, 1);
}

Image enlarged(const ImageView& image, const Roi& part, int factor) {
  const Roi in{std::max(0, part.u0), std::max(0, part.v0),
               std::min(image.width, part.u1), std::min(image.height, part.v1)};
  if (in.empty() || factor < 1) return {};
  Image result((in.u1 - in.u0) * factor, (in.v1 - in.v0) * factor, image.channels);
  for (int v = 0; v < result.height; ++v) {
    const std::uint8_t* from = image.row(in.v0 + v / factor);
    std::uint8_t* to = result.row(v);
    for (int u = 0; u < result.width; ++u) {
      const std::uint8_t* pixel = from + (in.u0 + u / factor) * image.channels;
      to = std::copy(pixel, pixel + image.channels, to);
    }
  }
  return result;
}

}  // namespace alight
