#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "alight/mission/relative_estimator.h"

namespace alight {

inline constexpr Time kFrame = 16'666'667;

/// A rig with a small picture: pixels as large as the authors', fewer of them.
inline Rig small_rig() {
  Rig rig = alan_rig();
  Intrinsics& lens = rig.camera.intrinsics;
  lens.width = 480;
  lens.height = 320;
  lens.cx = 239.5;
  lens.cy = 159.5;
  return rig;
}

/// A dark picture with Gaussian lights in it.
class Picture {
 public:
  explicit Picture(const Intrinsics& lens)
      : width_(lens.width),
        height_(lens.height),
        bytes_(static_cast<std::size_t>(lens.width * lens.height * 3), 3) {}

  void clear() { std::fill(bytes_.begin(), bytes_.end(), std::uint8_t{3}); }

  void add(const Vector2& uv, LedColor color, double peak = 700, double sd = 1.0) {
    const Vector3 bgr = color == LedColor::red     ? Vector3(0.25, 0.2, 1)
                        : color == LedColor::green ? Vector3(0.3, 1, 0.2)
                        : color == LedColor::blue  ? Vector3(1, 0.3, 0.2)
                                                   : Vector3(1, 1, 1);
    const int cu = static_cast<int>(std::lround(uv.x()));
    const int cv = static_cast<int>(std::lround(uv.y()));
    for (int v = std::max(cv - 6, 0); v <= std::min(cv + 6, height_ - 1); ++v) {
      for (int u = std::max(cu - 6, 0); u <= std::min(cu + 6, width_ - 1); ++u) {
        const double value =
            peak * std::exp(-(Vector2(u, v) - uv).squaredNorm() / (2 * sd * sd));
        for (int c = 0; c < 3; ++c) {
          auto& byte = bytes_[static_cast<std::size_t>((v * width_ + u) * 3 + c)];
          byte = static_cast<std::uint8_t>(std::min(byte + value * bgr[c], 255.0));
        }
      }
    }
  }

  /// Dark left of the column `u`.
  void cover(int u) {
    const int right = std::clamp(u, 0, width_);
    for (int v = 0; v < height_; ++v) {
      for (int i = 0; i < 3 * right; ++i) {
        bytes_[static_cast<std::size_t>(3 * v * width_ + i)] = 3;
      }
    }
  }

  void dot(int u, int v, std::uint8_t value) {
    bytes_[static_cast<std::size_t>((v * width_ + u) * 3)] = value;
  }

  ImageView view() const {
    return {bytes_.data(), width_, height_, 3, static_cast<std::ptrdiff_t>(width_) * 3};
  }

 private:
  int width_, height_;
  std::vector<std::uint8_t> bytes_;
};

/// An estimator, and the drone it looks at.
struct Watch {
  explicit Watch(const RelativeEstimatorConfig& config = config_for_tests(),
                 const Rig& rig_in = small_rig())
      : rig(rig_in),
        truth(rig_in),
        estimator(RelativeEstimator::create(config, rig_in).value()),
        picture(rig_in.camera.intrinsics) {}

  /// What is told is what is seen.
  static RelativeEstimatorConfig config_for_tests() {
    RelativeEstimatorConfig config = RelativeEstimatorConfig::camera_only();
    config.coast_s = 0;
    config.frozen_pictures = 0;
    config.told_when_it_rests = true;
    return config;
  }

  /// A drone that sways slowly about a place of the approach, upright.
  static Pose sway(Time t) {
    const double s = to_seconds(t);
    const Vector3 p_NB(-0.35 + 0.05 * std::sin(s), 0.06 * std::sin(0.8 * s),
                       0.35 + 0.04 * std::cos(1.1 * s));
    return make_pose(from_rpy(0, 0, 0.1 * std::sin(0.7 * s)), p_NB);
  }

  void draw(const Pose& X_NB, unsigned which = 0x3f) {
    picture.clear();
    add(X_NB, which);
  }
  void add(const Pose& X_NB, unsigned which = 0x3f) {
    for (int i = 0; i < truth.leds.size(); ++i) {
      if (((which >> i) & 1) == 0) continue;
      const auto uv = project_led(truth.camera, X_NB, truth.leds.p_BL(i));
      if (uv) picture.add(*uv, truth.leds.color(i));
    }
  }
  bool fuse(Time t) {
    CameraFrame frame;
    frame.captured = t;
    frame.received = t + 30'000'000;
    frame.color = picture.view();
    return estimator.fuse(frame, motion, report);
  }
  /// A picture of the drone where it truly is.
  bool look(Time t, unsigned which = 0x3f) {
    draw(sway(t), which);
    return fuse(t);
  }
  /// The last picture, as if it were a new one.
  bool again() {
    now += kFrame;
    return fuse(now);
  }
  /// Pictures in a row without the drone.
  void miss(int pictures) {
    picture.clear();
    for (int i = 0; i < pictures; ++i) again();
  }
  /// Pictures in a row, all tracked.
  void follow(int pictures) {
    for (int i = 0; i < pictures; ++i) {
      now += kFrame;
      ASSERT_TRUE(look(now));
      ASSERT_TRUE(report.tracked) << i << ": " << report.why_not;
    }
  }
  double position_error() const {
    return (report.x.p_NB - sway(report.t).translation()).norm();
  }
  double rotation_error_deg() const {
    return angle_between(report.x.R_NB, Matrix3(sway(report.t).linear())) / kDegree;
  }

  Rig rig, truth;
  RelativeEstimator estimator;
  Picture picture;
  NoMotion motion;
  FrameReport report;
  Time now = 0;
};

}  // namespace alight
