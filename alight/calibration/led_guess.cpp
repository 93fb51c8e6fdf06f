#include "alight/calibration/led_guess.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>
#include <set>

#include "alight/vision/pose_from_leds.h"

namespace alight {
namespace {

constexpr int kPicturesMin = 12;   // of a stretch
constexpr int kPicturesUsed = 24;  // spread over it
constexpr int kLightsMin = 5;
constexpr std::size_t kExchangesTried = 8;
constexpr int kNeighbours = 5;     // of an LED, that it may be mistaken for
constexpr int kStretches = 6;      // that are looked into
constexpr double kDepthMin = 0.1;  // px that the third dimension moves lights by
constexpr double kOutlierCost = 25;
constexpr double kCostMost = 4;   // of each number that was measured
constexpr double kNoisePx = 0.1;  // beyond the blobs' own
constexpr double kNever = std::numeric_limits<double>::infinity();

bool color_may_be(LedColor seen, LedColor led) {
  return seen == led || seen == LedColor::none || led == LedColor::none;
}

/// Successive pictures and the lights followed through all of them.
struct Stretch {
  int first = 0, last = 0;
  std::vector<const LightTrack*> lights;
  double depth_px = 0;

  int pictures() const { return last - first + 1; }
  /// The k-th of `n` pictures spread evenly over it.
  int picture(int k, int n) const { return first + k * (pictures() - 1) / (n - 1); }
};

/// How far, rms, the lights' third dimension moves them against a flat one (Tomasi and
/// Kanade 1992: the third singular value of their centred tracks).
double depth_shown(const Stretch& s) {
  const int n = std::min(kPicturesUsed, s.pictures());
  const auto lights = static_cast<Eigen::Index>(s.lights.size());
  Eigen::MatrixXd W(2 * n, lights);
  for (int k = 0; k < n; ++k) {
    for (Eigen::Index i = 0; i < lights; ++i) {
      W.block<2, 1>(2 * k, i) =
          s.lights[static_cast<std::size_t>(i)]->at(s.picture(k, n)).uv;
    }
  }
  W.colwise() -= W.rowwise().mean().eval();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(W);
  return svd.singularValues()(2) / std::sqrt(2.0 * n * static_cast<double>(lights));
}

std::vector<Stretch> stretches(const std::vector<const LightTrack*>& tracks,
                               int lights_min) {
  std::set<int> starts;
  for (const LightTrack* t : tracks) starts.insert(t->first);
  std::vector<Stretch> out;
  for (const int start : starts) {
    std::vector<const LightTrack*> lit;
    for (const LightTrack* t : tracks) {
      if (t->first <= start && t->last() >= start + kPicturesMin - 1) lit.push_back(t);
    }
    std::stable_sort(lit.begin(), lit.end(),
                     [](auto* a, auto* b) { return a->last() > b->last(); });
    for (std::size_t n = static_cast<std::size_t>(lights_min); n <= lit.size(); ++n) {
      if (n < lit.size() && lit[n]->last() == lit[n - 1]->last()) continue;
      Stretch s{start,
                lit[n - 1]->last(),
                {lit.begin(), lit.begin() + static_cast<std::ptrdiff_t>(n)},
                0};
      s.depth_px = depth_shown(s);
      if (s.depth_px > kDepthMin) out.push_back(std::move(s));
    }
  }
  std::stable_sort(out.begin(), out.end(), [](const Stretch& a, const Stretch& b) {
    return a.depth_px > b.depth_px;
  });
  std::vector<Stretch> best;
  for (const Stretch& s : out) {
    const bool new_part = std::all_of(best.begin(), best.end(), [&](const Stretch& b) {
      return std::min(s.last, b.last) - std::max(s.first, b.first) < s.pictures() / 2;
    });
    if (new_part) best.push_back(s);
    if (best.size() == kStretches) break;
  }
  return best;
}

/// Sum of squares by which `found` misses `meant` when it is laid over it, m^2.
double laid_over(const Eigen::Matrix3Xd& found, const Eigen::Matrix3Xd& meant) {
  const Eigen::Matrix4d lay = Eigen::umeyama(found, meant, false);
  return ((lay.topLeftCorner<3, 3>() * found).colwise() + lay.topRightCorner<3, 1>() -
          meant)
      .squaredNorm();
}

/// Names of a stretch's lights: which LED each is, then the LEDs that are none of them.
using Names = std::vector<int>;

class Namer {
 public:
  Namer(const LedAdjustmentConfig& config, const Camera& camera,
        const Constellation& written, const Stretch& stretch)
      : config_(config), camera_(camera), written_(written), stretch_(stretch) {}

  /// Whether a light that was taken for LED `was` may be `led`.
  bool may_be(std::size_t light, int was, int led) const {
    if (was == led) return true;
    return near(was, led) && color_fits(light, led);
  }

  /// By what single pictures took them for; false when the colours cannot be had.
  bool first_names(Names& names) const {
    const auto n = static_cast<std::size_t>(written_.size());
    if (stretch_.lights.size() > n) return false;
    std::vector<std::vector<int>> votes(stretch_.lights.size(), std::vector<int>(n, 0));
    for (std::size_t i = 0; i < stretch_.lights.size(); ++i) {
      for (int p = stretch_.first; p <= stretch_.last; ++p) {
        const int led = stretch_.lights[i]->at(p).taken_for;
        if (led >= 0) ++votes[i][static_cast<std::size_t>(led)];
      }
    }
    std::vector<int> name(stretch_.lights.size(), -1);
    std::vector<bool> given(n, false);
    for (std::size_t round = 0; round < name.size(); ++round) {
      int most = -1;
      std::size_t light = 0, led = 0;
      for (std::size_t i = 0; i < name.size(); ++i) {
        for (std::size_t k = 0; k < n && name[i] < 0; ++k) {
          if (given[k] || votes[i][k] <= most || !color_fits(i, static_cast<int>(k)))
            continue;
          most = votes[i][k];
          light = i;
          led = k;
        }
      }
      if (most < 0) return false;
      name[light] = static_cast<int>(led);
      given[led] = true;
    }
    names = name;
    for (std::size_t k = 0; k < n; ++k) {
      if (!given[k]) names.push_back(static_cast<int>(k));
    }
    return true;
  }

  /// Sum of squares by which the lights, found at `leds` under the names `was`, miss
  /// the LEDs written for `names` when laid over them, m^2.
  double misses(const Constellation& leds, const Names& was, const Names& names) const {
    const auto n = static_cast<Eigen::Index>(stretch_.lights.size());
    Eigen::Matrix3Xd found(3, n), meant(3, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      found.col(i) = leds.p_BL(was[static_cast<std::size_t>(i)]);
      meant.col(i) = written_.p_BL(names[static_cast<std::size_t>(i)]);
    }
    return laid_over(found, meant);
  }

  double cost(const Names& names, Constellation* leds) const {
    double best = kNever;
    for (const bool other_side : {false, true}) {
      const auto frames = frames_of(names, other_side);
      if (frames.empty()) continue;
      const auto fit = adjust_leds(config_, camera_, written_, written_, frames);
      if (!fit) continue;
      double sum = kOutlierCost * fit->rejected;
      for (std::size_t f = 0; f < frames.size(); ++f) {
        for (const LedObservation& o : frames[f].seen) {
          const auto uv =
              project_observation(camera_, fit->poses[f], fit->leds, o.leds);
          if (!uv) {
            sum += kOutlierCost;
            continue;
          }
          const Vector2 r = *uv - o.uv;
          const Matrix2 cov = o.cov + kNoisePx * kNoisePx * Matrix2::Identity();
          sum += std::min(kOutlierCost, r.dot(cov.inverse() * r));
        }
      }
      for (int i = 0; i < written_.size(); ++i) {
        sum += (fit->leds.p_BL(i) - written_.p_BL(i)).squaredNorm() /
               (config_.led_sd_m * config_.led_sd_m);
      }
      if (sum < best) {
        best = sum;
        if (leds != nullptr) *leds = fit->leds;
      }
    }
    return best;
  }

 private:
  bool color_fits(std::size_t light, int led) const {
    if (light >= stretch_.lights.size()) return true;
    return color_may_be(stretch_.lights[light]->color, written_.color(led));
  }

  bool near(int i, int j) const {
    const double apart = (written_.p_BL(i) - written_.p_BL(j)).norm();
    int nearer = 0;
    for (int k = 0; k < written_.size(); ++k) {
      if (k != i && (written_.p_BL(i) - written_.p_BL(k)).norm() < apart) ++nearer;
    }
    return nearer < kNeighbours;
  }

  std::vector<ObservedFrame> frames_of(const Names& names, bool other_side) const {
    std::vector<ObservedFrame> frames;
    const int n = std::min(kPicturesUsed, stretch_.pictures());
    for (int k = 0; k < n; ++k) {
      ObservedFrame frame;
      const int picture = stretch_.picture(k, n);
      frame.t = picture;
      for (std::size_t i = 0; i < stretch_.lights.size(); ++i) {
        const LightTrack::Sight& sight = stretch_.lights[i]->at(picture);
        LedObservation o;
        o.leds = static_cast<std::uint16_t>(1U << names[i]);
        o.uv = sight.uv;
        o.cov = sight.cov;
        frame.seen.push_back(o);
      }
      const ObservationSpan seen(frame.seen.data(), frame.seen.size());
      if (k == 0) {
        const auto fit = solve_pnp(camera_, written_, seen);
        if (!fit) return {};
        if (other_side && !std::isfinite(fit->runner_up_rms_px)) return {};
        frame.X_NB = other_side ? fit->X_NB_runner_up : fit->X_NB;
      } else {
        const auto fit = refine_pose(camera_, written_, seen, frames.back().X_NB);
        frame.X_NB = fit ? fit->X_NB : frames.back().X_NB;
      }
      frames.push_back(frame);
    }
    return frames;
  }

  const LedAdjustmentConfig& config_;
  const Camera& camera_;
  const Constellation& written_;
  const Stretch& stretch_;
};

/// Names that two or three LEDs near each other have exchanged.
std::vector<Names> exchanged(const Namer& namer, const Names& names,
                             std::size_t lights) {
  std::vector<Names> out;
  const auto try_it = [&](Names next) {
    for (std::size_t i = 0; i < next.size(); ++i) {
      if (!namer.may_be(i, names[i], next[i])) return;
    }
    out.push_back(std::move(next));
  };
  for (std::size_t i = 0; i < lights; ++i) {
    for (std::size_t j = i + 1; j < names.size(); ++j) {
      Names swapped = names;
      std::swap(swapped[i], swapped[j]);
      try_it(swapped);
      for (std::size_t k = j + 1; k < names.size(); ++k) {
        Names turned = names;
        turned[i] = names[j];
        turned[j] = names[k];
        turned[k] = names[i];
        try_it(turned);
        turned[i] = names[k];
        turned[j] = names[i];
        turned[k] = names[j];
        try_it(turned);
      }
    }
  }
  return out;
}

/// Of the exchanges those under which the lights as found lie nearest to the LEDs: what
/// lights are called changes their shape little, as far as pictures tell it.
std::vector<Names> nearest(const Namer& namer, const Names& names,
                           const Constellation& leds, std::size_t lights) {
  std::vector<std::pair<double, Names>> all;
  for (Names& next : exchanged(namer, names, lights)) {
    all.emplace_back(namer.misses(leds, names, next), std::move(next));
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Names> out;
  for (auto& [misses, next] : all) {
    if (out.size() < kExchangesTried) out.push_back(std::move(next));
  }
  return out;
}

Result<LedGuess> guess_from(const LedAdjustmentConfig& config, const Camera& camera,
                            const Constellation& written, const Stretch& stretch) {
  const Namer namer(config, camera, written, stretch);
  Names names;
  if (!namer.first_names(names)) return fail(Fault::too_few_points);
  LedGuess guess;
  guess.cost = namer.cost(names, &guess.leds);
  guess.pictures = stretch.pictures();
  guess.lights = static_cast<int>(stretch.lights.size());
  for (bool better = true; better;) {
    better = false;
    guess.margin = kNever;
    for (const Names& next : nearest(namer, names, guess.leds, stretch.lights.size())) {
      Constellation leds;
      const double cost = namer.cost(next, &leds);
      guess.margin = std::min(guess.margin, cost - guess.cost);
      if (cost >= guess.cost) continue;
      better = true;
      guess.cost = cost;
      guess.leds = leds;
      names = next;
    }
  }
  if (!std::isfinite(guess.cost)) return fail(Fault::too_few_points);
  return guess;
}

/// By its colour; where that tells nothing, some picture must have taken it for one.
bool may_be_led(const LightTrack& track, const Constellation& written) {
  bool by_color = false, color_fits = false;
  for (int i = 0; i < written.size(); ++i) {
    color_fits = color_fits || color_may_be(track.color, written.color(i));
    by_color =
        by_color || (track.color != LedColor::none && track.color == written.color(i));
  }
  return by_color ||
         (color_fits && std::any_of(track.seen.begin(), track.seen.end(),
                                    [](const auto& s) { return s.taken_for >= 0; }));
}

/// All of its lights move as those of one body. A lamp beside the drone does not.
bool holds_together(const LedGuess& guess) {
  const int numbers = 2 * guess.lights * std::min(kPicturesUsed, guess.pictures);
  return guess.cost < kCostMost * numbers;
}

/// The guess from a stretch, or from what is left without one of its lights.
Result<LedGuess> guess_without_lamp(const LedAdjustmentConfig& config,
                                    const Camera& camera, const Constellation& written,
                                    const Stretch& stretch, int lights_min) {
  const auto all = guess_from(config, camera, written, stretch);
  if (all && holds_together(*all)) return all;
  Result<LedGuess> best = fail(Fault::too_few_points);
  const bool spare = static_cast<int>(stretch.lights.size()) > lights_min;
  for (std::size_t lamp = 0; spare && lamp < stretch.lights.size(); ++lamp) {
    Stretch rest = stretch;
    rest.lights.erase(rest.lights.begin() + static_cast<std::ptrdiff_t>(lamp));
    rest.depth_px = depth_shown(rest);
    if (rest.depth_px <= kDepthMin) continue;
    const auto guess = guess_from(config, camera, written, rest);
    if (guess && holds_together(*guess) && (!best || guess->cost < best->cost)) {
      best = guess;
    }
  }
  return best;
}

/// A light that is missing may have run together with another through it all.
bool better(const LedGuess& a, const LedGuess& b) {
  return a.lights != b.lights ? a.lights > b.lights : a.margin > b.margin;
}

}  // namespace

Result<LedGuess> guess_leds(const LedAdjustmentConfig& config, const Camera& camera,
                            const Constellation& written,
                            std::span<const LightTrack> tracks) {
  Result<LedGuess> best = fail(Fault::too_few_points);
  std::vector<const LightTrack*> in_color;
  for (const LightTrack& t : tracks) {
    if (may_be_led(t, written)) in_color.push_back(&t);
  }
  const int lights_min = std::min(kLightsMin, written.size());
  for (const Stretch& stretch : stretches(in_color, lights_min)) {
    const auto guess = guess_without_lamp(config, camera, written, stretch, lights_min);
    if (guess && (!best || better(*guess, *best))) best = guess;
  }
  return best;
}

Constellation named_nearest(const Constellation& found, const Constellation& written) {
  assert(found.size() == written.size());
  const auto n = static_cast<Eigen::Index>(written.size());
  Eigen::Matrix3Xd at(3, n), meant(3, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    at.col(i) = found.p_BL(static_cast<int>(i));
    meant.col(i) = written.p_BL(static_cast<int>(i));
  }
  double least = laid_over(at, meant);
  for (;;) {
    Eigen::Index a = 0, b = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = i + 1; j < n; ++j) {
        if (written.color(static_cast<int>(i)) != written.color(static_cast<int>(j))) {
          continue;
        }
        Eigen::Matrix3Xd swapped = at;
        swapped.col(i).swap(swapped.col(j));
        const double misses = laid_over(swapped, meant);
        if (misses >= least) continue;
        least = misses;
        a = i;
        b = j;
      }
    }
    if (a == b) break;
    at.col(a).swap(at.col(b));
  }
  Constellation out = found;
  for (Eigen::Index i = 0; i < n; ++i) {
    out.leds[static_cast<std::size_t>(i)].p_BL = at.col(i);
  }
  return out;
}

}  // namespace alight
