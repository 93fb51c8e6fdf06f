#include "alight/vision/light_share.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace alight {
namespace {

// A camera changes its exposure by so much between pictures; by more if two lights of
// three and more say so that agree as well as this.
constexpr double kExposure = 0.05, kAgree = 0.1;
constexpr double kNearest_m = 0.1;
constexpr double kSds = 4;  // of how unsteady lights are; a light that is dimmer is cut
// An edge that lets through the share q of a Gaussian light of unit spread moves its
// middle by pdf / q, with the normal density where the edge stands: nearly a straight
// line in q down to a half.
constexpr double kDisplaced = 1.75;
constexpr double kFollows = 0.4;   // share of a change that is taken over at once
constexpr double kForgets = 0.06;  // the same of a light that is cut
constexpr double kCut = 0.15;      // so much of it is missing beyond doubt
constexpr double kMemory = 100;    // lights

}  // namespace

void LightShare::look(const Heights& heights, double range_m) {
  now_ = heights;
  range_now_m_ = std::max(range_m, kNearest_m);
  const double nearer = range_m_ > 0 ? range_m_ / range_now_m_ : 1;
  const double expected = std::clamp(nearer * nearer, 0.5, 2.0);
  FixedVector<double, kMaxLeds> ratios;
  for (std::size_t i = 0; i < heights.size(); ++i) {
    if (heights[i] > 0 && usual_[i] > 0) ratios.push_back(heights[i] / usual_[i]);
  }
  change_ = expected;
  if (!ratios.empty()) {
    // Those that shine most are whole; the very first may be a lamp's doing.
    std::sort(ratios.begin(), ratios.end(), std::greater<>());
    const bool several = ratios.size() > 2;
    change_ = ratios[several ? 1 : 0];
    if (!several || ratios[1] < (1 - kAgree) * ratios[0]) {
      change_ =
          std::clamp(change_, expected * (1 - kExposure), expected * (1 + kExposure));
    }
  }
  for (std::size_t i = 0; i < heights.size(); ++i) {
    const bool known = heights[i] > 0 && usual_[i] > 0;
    share_[i] = known ? heights[i] / (change_ * usual_[i]) : 1;
  }
}

bool LightShare::cut(double share) const { return 1 - share > kSds * unsteady_; }

double LightShare::displaced_px(int led, double sd_px) const {
  const double share = share_[static_cast<std::size_t>(led)];
  return cut(share) ? kDisplaced * (1 - share) * sd_px : 0;
}

bool LightShare::whole() const {
  return std::none_of(share_.begin(), share_.end(),
                      [&](double share) { return cut(share) && 1 - share > kCut; });
}

void LightShare::learn() {
  range_m_ = range_now_m_;
  for (std::size_t i = 0; i < now_.size(); ++i) {
    usual_[i] *= change_;
    if (!(now_[i] > 0)) continue;
    if (!(usual_[i] > 0)) {
      usual_[i] = now_[i];
      continue;
    }
    const bool is_cut = cut(share_[i]);
    usual_[i] += (is_cut ? kForgets : kFollows) * (now_[i] - usual_[i]);
    if (is_cut) continue;
    unsteady_ += (std::abs(1 - share_[i]) - unsteady_) / kMemory;
    unsteady_ = std::max(unsteady_, kSteady / kSds);
  }
}

}  // namespace alight
