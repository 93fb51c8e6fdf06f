#include "alight/sim/scene_at.h"

#include <algorithm>
#include <cmath>

#include "alight/geometry/so3.h"

namespace alight {

Pose between(const Pose& from, const Pose& to, double share) {
  const Vector3 turn = so3_log(from.linear().transpose() * to.linear());
  return make_pose(
      from.linear() * so3_exp(share * turn),
      from.translation() + share * (to.translation() - from.translation()));
}

Seconds exposure_of(const CameraTiming& timing, double factor) {
  return std::min(1e-3 * timing.exposure_ms * factor, 1 / timing.rate_hz);
}

Seconds span_of(const CameraTiming& timing, double factor) {
  return exposure_of(timing, factor) + 1e-3 * timing.readout_ms;
}

SceneAt RowScenes::at(double share) const {
  const double last = static_cast<double>(instants_.size() - 1);
  const double place = std::clamp(share, 0.0, 1.0) * last;
  const double before = std::min(std::floor(place), std::max(last - 1, 0.0));
  const auto k = static_cast<std::size_t>(before);
  const SceneAt& from = instants_[k];
  const SceneAt& to = instants_[std::min(k + 1, instants_.size() - 1)];
  return {between(from.X_IN, to.X_IN, place - before),
          between(from.X_NB, to.X_NB, place - before)};
}

std::span<const SceneAt> RowScenes::of_row(double v, Instants& room) const {
  if (!rolling()) return instants_;
  const double row = std::clamp(v / (height_ - 1), 0.0, 1.0);
  const double begin = row * readout_share_, exposed = 1 - readout_share_;
  room.clear();
  for (const double share : {0.0, 0.5, 1.0})
    room.push_back(at(begin + share * exposed));
  return {room.data(), room.size()};
}

}  // namespace alight
