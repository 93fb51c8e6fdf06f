#include "alight/vision/group_matcher.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace alight {
namespace {

// Wide patches, of a bright LED with its halo, are seldom round.
constexpr double kFloor = 0.25, kOfWidth = 0.35, kShare = 0.25;
/// chi^2 that one LED more in a group may cost: none of them suits every picture.
constexpr double kLedBonus[] = {3, 0, -9};
constexpr double kUnmatched = 9;  // cost of an LED or a blob that is left over

double width_of(const Blob& blob) {
  return std::max((blob.spread.trace() - stretch_of(blob.spread).norm()) / 2, 0.0);
}

using Pair = GroupScratch::Pair;
using Pairs = FixedVector<Pair, 256>;

/// One blob to one group, best first. @returns what it costs in all.
double best_first(Pairs& pairs, double led_bonus, Assignment& out) {
  std::sort(pairs.begin(), pairs.end(), [&](const Pair& a, const Pair& b) {
    const double cost_a = a.cost - led_bonus * (a.count - 1);
    const double cost_b = b.cost - led_bonus * (b.count - 1);
    if (cost_a != cost_b) return cost_a < cost_b;
    return a.leds != b.leds ? a.leds < b.leds : a.blob < b.blob;
  });
  // LEDs and, by their order among those near, blobs.
  unsigned placed = 0, wanted = 0;
  std::uint64_t used = 0, met = 0;
  double cost = 0;
  for (const Pair& pair : pairs) {
    wanted |= pair.leds;
    met |= pair.near;
    if ((pair.leds & placed) != 0 || (pair.near & used) != 0) continue;
    placed |= pair.leds;
    used |= pair.near;
    cost += pair.cost;
    ++out.blobs;
    out.leds += pair.count;
    for (unsigned left = pair.leds; left != 0; left &= left - 1) {
      out.blob[static_cast<std::size_t>(std::countr_zero(left))] = pair.blob;
    }
  }
  return cost +
         kUnmatched * (std::popcount(wanted & ~placed) + std::popcount(met & ~used));
}

}  // namespace

double stretch_sd(const Blob& blob, double expected, double image_sd_px) {
  const double width = width_of(blob);
  return kFloor + kOfWidth * width * width + kShare * expected +
         image_sd_px * std::sqrt(expected);
}

void led_groups(const LedImages& images, const Constellation& leds, double gap_max_px,
                LedGroups& groups) {
  groups.clear();
  const auto n = static_cast<std::size_t>(leds.size());
  const auto add = [&](std::initializer_list<std::size_t> members, double gap) {
    LedGroup group;
    group.gap_px = gap;
    group.count = static_cast<int>(members.size());
    for (const std::size_t i : members) {
      group.leds = static_cast<std::uint16_t>(group.leds | (1u << i));
      group.middle += images.uv[i] / group.count;
    }
    for (const std::size_t i : members) {
      const Vector2 d = images.uv[i] - group.middle;
      group.stretch +=
          Vector2(d.x() * d.x() - d.y() * d.y(), 2 * d.x() * d.y()) / group.count;
    }
    groups.push_back(group);
  };
  const auto gap = [&](std::size_t i, std::size_t k) {
    return images.in_front[i] && images.in_front[k]
               ? (images.uv[i] - images.uv[k]).norm()
               : 1e9;
  };
  for (std::size_t i = 0; i < n; ++i) {
    if (images.in_front[i]) add({i}, 0);
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = i + 1; k < n; ++k) {
      const double ik = gap(i, k);
      if (ik < gap_max_px) add({i, k}, ik);
      if (ik >= 2 * gap_max_px) continue;
      for (std::size_t m = k + 1; m < n; ++m) {
        // A chain holds together when the longest of the three sides is left out.
        const double im = gap(i, m), km = gap(k, m);
        const double longest = std::max({ik, im, km}), least = std::min({ik, im, km});
        const double step = std::max(ik + im + km - longest - least, least);
        if (step < gap_max_px) add({i, k, m}, step);
      }
    }
  }
}

Assignment match_groups(const LedImages& images, const Constellation& leds,
                        BlobSpan blobs, std::span<const int> candidates,
                        const GroupRule& rule, GroupScratch& scratch) {
  auto& [groups, pairs, near] = scratch;
  pairs.clear();
  near.clear();
  double widest = 0;
  const double reach = images.size_px + rule.tolerance_px;
  for (const int j : candidates) {
    const Blob& blob = blobs[static_cast<std::size_t>(j)];
    if ((blob.uv - images.middle).squaredNorm() > reach * reach) continue;
    if (!near.push_back(j)) break;
    widest = std::max(widest, width_of(blob));
  }
  if (near.empty()) return {};
  const auto merge_of = [&](double width) {
    return std::max(rule.merge_px, 4 * std::sqrt(width) + 2);
  };
  led_groups(images, leds, merge_of(widest), groups);
  const double reach2 = rule.tolerance_px * rule.tolerance_px;
  for (std::size_t k = 0; k < near.size(); ++k) {
    const int j = near[k];
    const Blob& blob = blobs[static_cast<std::size_t>(j)];
    const double merge = merge_of(width_of(blob));
    const Vector2 stretch = stretch_of(blob.spread);
    std::uint16_t agree = 0, washed = 0;
    for (int i = 0; i < leds.size(); ++i) {
      const bool good =
          !rule.use_color || colors_agree(blob.color, leds.color(i), rule.white_is_any);
      if (good) agree = static_cast<std::uint16_t>(agree | (1u << i));
      if (rule.use_color && blob.color == LedColor::white &&
          leds.color(i) != LedColor::white && leds.color(i) != LedColor::none) {
        washed = static_cast<std::uint16_t>(washed | (1u << i));
      }
    }
    for (const LedGroup& group : groups) {
      if ((group.leds & ~agree) != 0 || group.gap_px > merge) continue;
      const double d2 = (blob.uv - group.middle).squaredNorm();
      if (d2 > reach2) continue;
      const double sd = stretch_sd(blob, group.stretch.norm(), rule.image_sd_px);
      const double q2 = (stretch - group.stretch).squaredNorm() / (sd * sd);
      if (q2 > rule.stretch_gate_sd * rule.stretch_gate_sd) continue;
      double cost = 9 * d2 / reach2 + q2;
      if ((group.leds & washed) != 0) cost += 4;
      const std::uint64_t bit = std::uint64_t{1} << k;
      if (!pairs.push_back({cost, group.count, group.leds, j, bit})) break;
    }
  }
  const bool any_group = std::any_of(pairs.begin(), pairs.end(),
                                     [](const Pair& pair) { return pair.count > 1; });
  Assignment best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (const double bonus : kLedBonus) {
    Assignment out;
    const double cost = best_first(pairs, bonus, out);
    if (cost < best_cost) {
      best_cost = cost;
      best = out;
    }
    if (!any_group) break;
  }
  return best;
}

}  // namespace alight
