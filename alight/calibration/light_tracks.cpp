#include "alight/calibration/light_tracks.h"

#include <algorithm>
#include <bit>
#include <limits>

namespace alight {
namespace {

constexpr double kShiftMost = 40;  // px that the velocity may change by in one picture
constexpr double kNear = 3;        // px from where the common motion puts a light
constexpr double kApart = 8;       // px: nearer lights may run together
constexpr double kReach = 1.6;     // of the drone's radius in the picture, and
constexpr double kMargin = 10;     // px: where its other lights are
constexpr std::size_t kFollowedMost = 2 * kMaxLeds;

bool same_color(LedColor a, LedColor b) {
  return a == b || a == LedColor::none || b == LedColor::none;
}

}  // namespace

Vector2 LightTracks::expected(const Followed& f) const {
  return tracks_[f.track].seen.back().uv + f.velocity;
}

Vector2 LightTracks::common_shift(BlobSpan lights) const {
  Vector2 best = Vector2::Zero();
  int most = 0;
  for (const Followed& f : followed_) {
    for (const Blob& light : lights) {
      const Vector2 shift = light.uv - expected(f);
      if (shift.norm() > kShiftMost ||
          !same_color(light.color, tracks_[f.track].color)) {
        continue;
      }
      int agree = 0;
      for (const Followed& other : followed_) {
        const Vector2 at = expected(other) + shift;
        agree += std::any_of(lights.begin(), lights.end(), [&](const Blob& b) {
          return (b.uv - at).norm() < kNear &&
                 same_color(b.color, tracks_[other.track].color);
        });
      }
      if (agree > most || (agree == most && shift.norm() < best.norm())) {
        most = agree;
        best = shift;
      }
    }
  }
  return best;
}

void LightTracks::follow(BlobSpan lights, std::vector<bool>& used) {
  const Vector2 shift = common_shift(lights);
  const std::size_t n = followed_.size();
  constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> taken(n, kNone);
  for (std::size_t i = 0; i < n; ++i) {
    const Vector2 at = expected(followed_[i]) + shift;
    double nearest = kNear, second = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < lights.size(); ++k) {
      if (!same_color(lights[k].color, tracks_[followed_[i].track].color)) continue;
      const double d = (lights[k].uv - at).norm();
      if (d < nearest) {
        second = nearest < kNear ? nearest : second;
        nearest = d;
        taken[i] = k;
      } else {
        second = std::min(second, d);
      }
    }
    if (second < 2 * nearest + 1) taken[i] = kNone;
  }
  // Two that want one light have run together; so may have one whose neighbour is gone.
  std::vector<bool> ends(n, false);
  for (std::size_t i = 0; i < n; ++i) {
    ends[i] = ends[i] || taken[i] == kNone;
    for (std::size_t j = 0; j < n; ++j) {
      if (i == j) continue;
      const bool near =
          (expected(followed_[i]) - expected(followed_[j])).norm() < kApart;
      if (taken[i] != kNone && (taken[i] == taken[j] || (near && taken[j] == kNone))) {
        ends[i] = true;
      }
    }
  }
  std::vector<Followed> next;
  for (std::size_t i = 0; i < n; ++i) {
    if (taken[i] != kNone) used[taken[i]] = true;
    if (ends[i]) continue;
    LightTrack& track = tracks_[followed_[i].track];
    const Blob& light = lights[taken[i]];
    next.push_back({followed_[i].track, light.uv - track.seen.back().uv});
    track.seen.push_back({light.uv, light.cov, -1});
    if (track.color == LedColor::none) track.color = light.color;
  }
  followed_ = std::move(next);
}

void LightTracks::begin(BlobSpan lights, const ObservedFrame* observed,
                        const std::vector<bool>& used) {
  Vector2 middle = Vector2::Zero();
  double radius = 0;
  if (observed != nullptr) {
    const auto n = static_cast<double>(observed->seen.size());
    for (const LedObservation& o : observed->seen) middle += o.uv / n;
    for (const LedObservation& o : observed->seen) {
      radius = std::max(radius, (o.uv - middle).norm());
    }
  }
  const auto of_drone = [&](const Blob& light) {
    if (observed != nullptr && (light.uv - middle).norm() < kReach * radius + kMargin) {
      return true;
    }
    return light.color != LedColor::none &&
           std::any_of(leds_.leds.begin(), leds_.leds.end(),
                       [&](const Led& led) { return led.color == light.color; });
  };
  Vector2 velocity = Vector2::Zero();
  for (const Followed& f : followed_) {
    velocity += f.velocity / static_cast<double>(followed_.size());
  }
  for (std::size_t k = 0; k < lights.size(); ++k) {
    if (followed_.size() == kFollowedMost) return;
    if (used[k] || lights[k].cut || !of_drone(lights[k])) continue;
    followed_.push_back({tracks_.size(), velocity});
    tracks_.push_back({lights[k].color, picture_, {{lights[k].uv, lights[k].cov, -1}}});
  }
}

void LightTracks::add(BlobSpan blobs, const ObservedFrame* observed) {
  ++picture_;
  std::vector<bool> used(blobs.size(), false);
  follow(blobs, used);
  begin(blobs, observed, used);
  if (observed == nullptr) return;
  for (const Followed& f : followed_) {
    LightTrack::Sight& sight = tracks_[f.track].seen.back();
    for (const LedObservation& o : observed->seen) {
      if (std::has_single_bit(o.leds) && (o.uv - sight.uv).norm() < 1) {
        sight.taken_for = std::countr_zero(o.leds);
      }
    }
  }
}

}  // namespace alight
