#include "alight/vision/constellation_check.h"

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <iomanip>
#include <sstream>

#include "alight/vision/widest_triangle.h"

namespace alight {
namespace {

constexpr double kSure = 3;        // sd of LED positions by which a shape must show
constexpr double kClear_px = 1.5;  // by which it must show in the picture
constexpr double kSpan_px = 16;    // of a constellation whose attitude can be told
constexpr double kSamePose = 12 * kDegree;
constexpr double kBlind_m = 0.5;  // range within which that must be so

std::string number(double x, int digits) {
  std::ostringstream text;
  text << std::fixed << std::setprecision(digits) << x;
  return text.str();
}

std::string mm(double m) { return number(1000 * m, 0) + " mm"; }

/// Line and plane that fit best, through the middle.
struct Shape {
  Vector3 middle = Vector3::Zero();
  Vector3 along, normal;
  double off_line = 0, off_plane = 0;  // farthest LED
  int farthest_off_plane = 0;
  int nearest_to_middle = 0;
  double span = 0;  // largest distance between two
};

Shape shape_of(const Constellation& leds, int without = -1) {
  Shape out;
  const int n = leds.size();
  Eigen::Matrix<double, 3, kMaxLeds> p = Eigen::Matrix<double, 3, kMaxLeds>::Zero();
  int count = 0;
  for (int i = 0; i < n; ++i) {
    if (i != without) p.col(count++) = leds.p_BL(i);
  }
  out.middle = p.leftCols(count).rowwise().mean();
  const Eigen::MatrixXd q = p.leftCols(count).colwise() - out.middle;
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(q, Eigen::ComputeFullU);
  out.along = svd.matrixU().col(0);
  out.normal = svd.matrixU().col(2);
  double nearest = 1e9;
  for (int i = 0; i < n; ++i) {
    if (i == without) continue;
    const Vector3 d = leds.p_BL(i) - out.middle;
    out.off_line = std::max(out.off_line, (d - d.dot(out.along) * out.along).norm());
    const double off_plane = std::abs(d.dot(out.normal));
    if (off_plane > out.off_plane) {
      out.off_plane = off_plane;
      out.farthest_off_plane = i;
    }
    if (d.norm() < nearest) {
      nearest = d.norm();
      out.nearest_to_middle = i;
    }
    for (int j = 0; j < i; ++j) {
      if (j == without) continue;
      out.span = std::max(out.span, (leds.p_BL(i) - leds.p_BL(j)).norm());
    }
  }
  return out;
}

/// A turn that maps the LEDs onto each other.
struct Likeness {
  Matrix3 R = Matrix3::Identity();
  std::array<int, kMaxLeds> to{};
  double off = 1e9;  // m, the LED that meets its image worst
  int worst = 0;
};

bool exchangeable(const Constellation& leds, int i, int j, bool use_color) {
  const LedColor a = leds.color(i), b = leds.color(j);
  return !use_color || a == b || a == LedColor::none || b == LedColor::none;
}

Matrix3 axes_of(const Vector3& a, const Vector3& b) {
  const Vector3 x = a.normalized(), z = a.cross(b).normalized();
  Matrix3 axes;
  axes << x, z.cross(x), z;
  return axes;
}

/// Whether a drone turned so would be seen in flight as well as one that is not.
bool both_fly(const Constellation& leds, const Shape& shape, const Matrix3& R,
              const ConstellationUse& use) {
  const double tips = std::acos(std::clamp(R(2, 2), -1.0, 1.0));
  if (tips > (2 * use.tilt_max_deg + 10) * kDegree) return false;
  const Vector2 side = shape.middle.head<2>();
  double radius = 0;
  for (const Led& led : leds.leds) {
    radius = std::max(radius, (led.p_BL - shape.middle).norm());
  }
  if (!use.one_sided || side.norm() < 0.25 * radius) return true;
  return std::abs(yaw_of(R)) < 150 * kDegree;
}

/// The likeness that would deceive most, the identity left out.
Likeness most_alike(const Constellation& leds, const Shape& shape,
                    const ConstellationUse& use, double limit) {
  const int n = leds.size();
  // The widest triangle is what others are laid upon.
  const auto corners = widest_triangle(static_cast<std::size_t>(n), [&](std::size_t i) {
    return leds.p_BL(static_cast<int>(i));
  });
  const int a = static_cast<int>(corners[0]), b = static_cast<int>(corners[1]),
            c = static_cast<int>(corners[2]);
  const auto side = [&](int i, int j) { return Vector3(leds.p_BL(j) - leds.p_BL(i)); };
  const Matrix3 from = axes_of(side(a, b), side(a, c));
  Likeness best;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) {
      for (int k = 0; k < n; ++k) {
        if (i == j || i == k || j == k || (i == a && j == b && k == c)) continue;
        if (!exchangeable(leds, a, i, use.use_color) ||
            !exchangeable(leds, b, j, use.use_color) ||
            !exchangeable(leds, c, k, use.use_color) ||
            std::abs(side(i, j).norm() - side(a, b).norm()) > 2 * limit ||
            std::abs(side(i, k).norm() - side(a, c).norm()) > 2 * limit ||
            std::abs(side(j, k).norm() - side(b, c).norm()) > 2 * limit) {
          continue;
        }
        Likeness like;
        like.R = axes_of(side(i, j), side(i, k)) * from.transpose();
        const Vector3 shift = (leds.p_BL(i) + leds.p_BL(j) + leds.p_BL(k)) / 3 -
                              like.R * (leds.p_BL(a) + leds.p_BL(b) + leds.p_BL(c)) / 3;
        if (angle_between(like.R, Matrix3::Identity()) < kSamePose ||
            !both_fly(leds, shape, like.R, use)) {
          continue;
        }
        like.off = 0;
        std::uint32_t taken = 0;
        for (int l = 0; l < n; ++l) {
          const Vector3 there = like.R * leds.p_BL(l) + shift;
          double nearest = 1e9;
          int to = l;
          for (int m = 0; m < n; ++m) {
            if (((taken >> m) & 1) != 0 || !exchangeable(leds, l, m, use.use_color)) {
              continue;
            }
            const double d = (leds.p_BL(m) - there).norm();
            if (d < nearest) {
              nearest = d;
              to = m;
            }
          }
          taken |= 1u << to;
          like.to[static_cast<std::size_t>(l)] = to;
          if (nearest > like.off) {
            like.off = nearest;
            like.worst = l;
          }
        }
        if (like.off < best.off) best = like;
      }
    }
  }
  return best;
}

std::string say(const Constellation& leds, const Likeness& like) {
  std::string pairs;
  for (int l = 0; l < leds.size(); ++l) {
    const int to = like.to[static_cast<std::size_t>(l)];
    if (to == l) continue;
    pairs +=
        (pairs.empty() ? "" : ", ") + std::to_string(l) + " for " + std::to_string(to);
  }
  const double turn = angle_between(like.R, Matrix3::Identity()) / kDegree;
  return "turned by " + number(turn, 0) + " deg the LEDs look the same to " +
         mm(like.off) + " (" + pairs + ")";
}

}  // namespace

ConstellationReport check_constellation(const Constellation& leds,
                                        const Intrinsics& lens,
                                        const ConstellationUse& use) {
  ConstellationReport report;
  const auto refuse = [&](const std::string& why) {
    if (report.refusal.empty()) report.refusal = why;
  };
  const int n = leds.size();
  if (n < 4) {
    refuse("leds: a pose needs at least 4 LEDs, the rig has " + std::to_string(n));
    return report;
  }
  // What has to stand out: from the ruler's error, and in the picture at that range.
  const double sure = std::max(kSure * use.led_sd_m, 0.001);
  const double clear = std::max(sure, kClear_px * use.range_m / lens.fx);
  const Shape shape = shape_of(leds);
  const double told_to = lens.fx * shape.span / kSpan_px;
  if (told_to < kBlind_m) {
    refuse("leds: the two farthest apart are " + mm(shape.span) +
           " from each other, too little for this lens beyond " + number(told_to, 2) +
           " m; spread them over at least " + mm(kSpan_px * use.range_m / lens.fx));
    return report;
  }
  if (shape.off_line < std::max(sure, 0.05 * shape.span)) {
    refuse("leds: all " + std::to_string(n) + " stand within " + mm(shape.off_line) +
           " of a line, about which a turn cannot be seen; move LED " +
           std::to_string(shape.nearest_to_middle) + " at least " +
           mm(std::max(0.25 * shape.span, 2 * clear)) + " to its side");
    return report;
  }
  const Likeness like = most_alike(leds, shape, use, 2 * clear);
  if (like.off < sure) {
    refuse("leds: " + say(leds, like) +
           ", so that the drone's heading cannot be told; move LED " +
           std::to_string(like.worst) + " by at least " + mm(2 * clear) +
           " or give it another colour");
    return report;
  }
  if (like.off < clear) {
    report.warnings.push_back(
        "leds: " + say(leds, like) + ", which shows by less than " +
        number(kClear_px, 1) + " px from " + number(use.range_m, 1) +
        " m; starts may take longer there: move LED " + std::to_string(like.worst) +
        " by " + mm(2 * clear) + " or give it another colour");
  }
  if (shape.off_plane < sure) {
    report.warnings.push_back(
        "leds: all stand within " + mm(shape.off_plane) +
        " of one plane, so that from afar two attitudes look alike; move LED " +
        std::to_string(shape.nearest_to_middle) + " out of it by at least " +
        mm(2 * clear));
  }
  for (int i = 0; i < n && n > 4; ++i) {
    const Shape rest = shape_of(leds, i);
    if (rest.off_line >= std::max(sure, 0.05 * rest.span)) continue;
    report.warnings.push_back("leds: without LED " + std::to_string(i) +
                              " the others stand in a line; if it is hidden the pose "
                              "is lost: move another one off that line as well");
  }
  if (told_to < use.range_m) {
    report.warnings.push_back("leds: the two farthest apart are " + mm(shape.span) +
                              " from each other; beyond " + number(told_to, 1) +
                              " m this lens tells no attitude from them");
  }
  if (n == 4) {
    report.warnings.push_back(
        "leds: there are four, so that with one of them hidden no pose can be found; "
        "add two");
  }
  return report;
}

}  // namespace alight
