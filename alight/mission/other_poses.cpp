#include "alight/mission/other_poses.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <bit>

#include "alight/vision/widest_triangle.h"

namespace alight {
namespace {

// LEDs taken for others; without colours each may be any.
constexpr int kMostChanges = 3, kMostChangesUncolored = 2;
constexpr int kMostTried = 120;
constexpr int kRoughSteps = 6;  // after which a reading
constexpr double kRough = 4;    // that fits so many times worse than asked is given up
constexpr double kApart = 5 * kDegree;  // of two poses with the same LEDs

class Readings {
 public:
  Readings(const Camera& camera, const Constellation& leds, bool use_color,
           const LedFinder& plausible, ObservationSpan seen, double rms_max_px,
           OtherPoses& out)
      : camera_(camera),
        leds_(leds),
        use_color_(use_color),
        plausible_(plausible),
        seen_(seen),
        rms_max_px_(rms_max_px),
        out_(out) {
    for (const LedObservation& o : seen) reading_.push_back(o);
  }

  void add(const PoseFit& fit) {
    if (fit.rms_px > rms_max_px_ || !plausible_.plausible(fit.X_NB)) return;
    if (out_.full()) {
      if (out_.back().fit.rms_px <= fit.rms_px) return;
      out_.truncate(out_.size() - 1);
    }
    out_.push_back({reading_, fit});
    for (std::size_t n = out_.size() - 1; n > 0; --n) {
      if (out_[n].fit.rms_px < out_[n - 1].fit.rms_px) std::swap(out_[n], out_[n - 1]);
    }
  }

  /// All with `most` changes at most from light `n` on.
  void read_on(std::size_t n, int most, unsigned used, bool changed) {
    if (n == seen_.size()) {
      if (changed) try_out();
      return;
    }
    const std::uint16_t own = seen_[n].leds;
    // LEDs run together may as well be one of them.
    if ((used & own) == 0) read_on(n + 1, most, used | own, changed);
    const LedColor color = leds_.color(std::countr_zero(own));
    for (int i = 0; i < leds_.size() && most > 0; ++i) {
      const auto led = static_cast<std::uint16_t>(1u << i);
      if (led == own || (used & led) != 0 || (use_color_ && leds_.color(i) != color)) {
        continue;
      }
      reading_[n].leds = led;
      read_on(n + 1, most - 1, used | led, true);
    }
    reading_[n].leds = own;
  }

 private:
  void try_out() {
    if (++tried_ > kMostTried) return;
    const ObservationSpan read(reading_.data(), reading_.size());
    // Three of them and a few steps tell most that are none.
    const auto corner =
        widest_triangle(read.size(), [&](std::size_t i) { return first_led(read[i]); });
    Vector3 p_BL[3];
    Vector2 uv[3];
    for (std::size_t n = 0; n < 3; ++n) {
      p_BL[n] = first_led(read[corner[n]]);
      uv[n] = read[corner[n]].uv;
    }
    const ThreePointPoses start = three_point_poses(camera_.intrinsics, p_BL, uv);
    for (int n = 0; n < start.count; ++n) {
      const Pose X_NB = camera_.X_NC * start.X_CB[n];
      const auto rough = refine_pose(camera_, leds_, read, X_NB, nullptr, kRoughSteps);
      if (!rough || rough->rms_px > kRough * rms_max_px_) continue;
      const auto fit = refine_pose(camera_, leds_, read, rough->X_NB, nullptr, 15);
      if (fit) add(*fit);
    }
  }

  const Vector3& first_led(const LedObservation& o) const {
    return leds_.p_BL(std::countr_zero(o.leds));
  }

  const Camera& camera_;
  const Constellation& leds_;
  bool use_color_;
  const LedFinder& plausible_;
  ObservationSpan seen_;
  double rms_max_px_;
  OtherPoses& out_;
  FixedVector<LedObservation, kMaxLeds> reading_;
  int tried_ = 0;
};

}  // namespace

std::optional<PoseFit> mirrored_pose(const Camera& camera, const Constellation& leds,
                                     ObservationSpan seen, const Pose& X_NB) {
  // From afar a flat body looks the same turned half about its normal and half about
  // the line of sight.
  Vector3 middle = Vector3::Zero();
  Matrix3 square = Matrix3::Zero();
  const auto count = static_cast<double>(seen.size());
  for (const LedObservation& o : seen) {
    Vector3 p = Vector3::Zero();
    for (int i = 0; i < leds.size(); ++i) {
      if (((o.leds >> i) & 1) != 0) p += leds.p_BL(i) / std::popcount(o.leds);
    }
    middle += p / count;
    square += p * p.transpose() / count;
  }
  Eigen::SelfAdjointEigenSolver<Matrix3> axes;
  axes.computeDirect(square - middle * middle.transpose());
  const Vector3 centre = X_NB * middle;
  const Vector3 sight = (centre - camera.X_NC.translation()).normalized();
  const Matrix3 R =
      so3_exp(kPi * sight) * X_NB.linear() * so3_exp(kPi * axes.eigenvectors().col(0));
  const auto fit =
      refine_pose(camera, leds, seen, make_pose(R, centre - R * middle), nullptr, 10);
  if (!fit || angle_between(fit->X_NB.linear(), X_NB.linear()) < kApart) return {};
  return *fit;
}

void find_other_poses(const Camera& camera, const Constellation& leds, bool use_color,
                      const LedFinder& plausible, ObservationSpan seen,
                      const Pose& X_NB, double rms_max_px, OtherPoses& out) {
  out.clear();
  Readings readings(camera, leds, use_color, plausible, seen, rms_max_px, out);
  if (const auto fit = mirrored_pose(camera, leds, seen, X_NB)) readings.add(*fit);
  const int most = use_color ? kMostChanges : kMostChangesUncolored;
  readings.read_on(0, seen.size() > 5 ? 1 : most, 0, false);
}

}  // namespace alight
