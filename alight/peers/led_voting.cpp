#include "alight/peers/led_voting.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alight/peers/p3p.h"

namespace alight {
namespace {

/// Calls `visit(i, j, k)` for every i < j < k below `count`.
template <class Visit>
void each_triple(int count, Visit&& visit) {
  for (int i = 0; i < count; ++i) {
    for (int j = i + 1; j < count; ++j) {
      for (int k = j + 1; k < count; ++k) visit(i, j, k);
    }
  }
}

}  // namespace

LedVoting::LedVoting(const LedVotingConfig& config, const Intrinsics& lens,
                     const Constellation& leds)
    : config_(config), lens_(lens), leds_(leds) {}

void LedVoting::vote(const Lights& lights, const Pose& X_CB, const int led[3],
                     const int light[3]) {
  const double gate2 = config_.back_projection_px * config_.back_projection_px;
  LedMatches met;
  int others = 0;
  for (int m = 0; m < leds_.size(); ++m) {
    if (m == led[0] || m == led[1] || m == led[2]) continue;
    ++others;
    const auto uv = lens_.project(X_CB * leds_.p_BL(m));
    if (!uv) return;
    int nearest = -1;
    double nearest2 = gate2;
    for (int d = 0; d < lights.size(); ++d) {
      const double distance2 =
          (*uv - lights.uv[static_cast<std::size_t>(d)]).squaredNorm();
      if (distance2 < nearest2 && d != light[0] && d != light[1] && d != light[2]) {
        nearest = d;
        nearest2 = distance2;
      }
    }
    if (nearest >= 0) met.push_back({m, nearest});
  }
  const int possible = std::min(others, lights.size() - 3);
  if (met.empty() || static_cast<int>(met.size()) < config_.certainty * possible)
    return;
  const auto add = [&](int m, int d) {
    ++votes_[static_cast<std::size_t>(m * lights.size() + d)];
  };
  for (int i = 0; i < 3; ++i) add(led[i], light[i]);
  for (const LedMatch& match : met) add(match.led, match.light);
}

LedMatches LedVoting::search(const Lights& lights) {
  LedMatches none;
  if (lights.size() < 4 || leds_.size() < 4) return none;
  votes_.assign(static_cast<std::size_t>(leds_.size() * lights.size()), 0);
  each_triple(lights.size(), [&](int a, int b, int c) {
    const int light[3] = {a, b, c};
    Vector3 rays[3];
    for (int i = 0; i < 3; ++i) {
      rays[i] = lights.rays[static_cast<std::size_t>(light[i])];
    }
    for (int i = 0; i < leds_.size(); ++i) {
      for (int j = 0; j < leds_.size(); ++j) {
        for (int k = 0; k < leds_.size(); ++k) {
          if (i == j || i == k || j == k) continue;
          const int led[3] = {i, j, k};
          const Vector3 p_B[3] = {leds_.p_BL(i), leds_.p_BL(j), leds_.p_BL(k)};
          for (const Pose& X_CB : solve_p3p(p_B, rays)) vote(lights, X_CB, led, light);
        }
      }
    }
  });

  LedMatches best;
  while (!best.full()) {
    const auto most = std::max_element(votes_.begin(), votes_.end());
    if (*most == 0) break;
    const int at = static_cast<int>(most - votes_.begin());
    const LedMatch match{at / lights.size(), at % lights.size()};
    best.push_back(match);
    for (int i = 0; i < static_cast<int>(votes_.size()); ++i) {
      if (i / lights.size() == match.led || i % lights.size() == match.light) {
        votes_[static_cast<std::size_t>(i)] = 0;
      }
    }
  }
  // What few poses vote for is chance: left out as long as the rest does not agree.
  Pose X_CB;
  while (best.size() >= 4 && !agree(lights, best, X_CB)) {
    best.truncate(best.size() - 1);
  }
  return best.size() >= 4 ? best : none;
}

bool LedVoting::agree(const Lights& lights, const LedMatches& matches,
                      Pose& X_CB) const {
  const int count = static_cast<int>(matches.size());
  if (count < 4) return false;
  const double gate2 = config_.back_projection_px * config_.back_projection_px;
  int triples = 0, valid = 0;
  double least = std::numeric_limits<double>::infinity();
  each_triple(count, [&](int a, int b, int c) {
    ++triples;
    Vector3 p_B[3], rays[3];
    const int triple[3] = {a, b, c};
    for (int i = 0; i < 3; ++i) {
      const LedMatch& match = matches[static_cast<std::size_t>(triple[i])];
      p_B[i] = leds_.p_BL(match.led);
      rays[i] = lights.rays[static_cast<std::size_t>(match.light)];
    }
    bool good = false;
    for (const Pose& X : solve_p3p(p_B, rays)) {
      double sum = 0;
      int near = 0;
      for (const LedMatch& match : matches) {
        const auto uv = lens_.project(X * leds_.p_BL(match.led));
        if (!uv) {
          near = 0;
          break;
        }
        const double distance2 =
            (*uv - lights.uv[static_cast<std::size_t>(match.light)]).squaredNorm();
        sum += distance2;
        near += distance2 < gate2;
      }
      if (near - 3 < config_.certainty * (count - 3)) continue;
      good = true;
      if (sum < least) {
        least = sum;
        X_CB = X;
      }
    }
    valid += good;
  });
  return std::isfinite(least) && valid >= config_.valid_share * triples;
}

}  // namespace alight
