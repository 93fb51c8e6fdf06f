#include "alight/vision/shape_table.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace alight {
namespace {

constexpr int kSamples = 100000;

// Tangents of the angles between the sectors of a quadrant.
constexpr double kEdges[] = {
    0.19891236737965800, 0.41421356237309505, 0.66817863791929892, 1,
    1.4966057626654890,  2.4142135623730950,  5.0273394921258483};

/// Sector of a direction, one of 32, by comparing instead of an arctangent.
std::size_t sector(const Vector2& e) {
  const double x = std::abs(e.x()), y = std::abs(e.y());
  std::size_t from_x = 0;
  for (const double edge : kEdges) from_x += y >= edge * x;
  if (e.y() >= 0) return e.x() >= 0 ? 16 + from_x : 31 - from_x;
  return e.x() >= 0 ? 15 - from_x : from_x;
}

}  // namespace

CoveringTriples covering_triples(const Constellation& leds) {
  struct Entry {
    std::array<int, 3> triple;
    unsigned mask;
    double area;
  };
  std::vector<Entry> all;
  const int n = leds.size();
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j < n; ++j) {
      for (int k = j + 1; k < n; ++k) {
        // The longest side goes first: the other corner is then placed best.
        std::array<std::array<int, 3>, 3> turns{{{i, j, k}, {j, k, i}, {k, i, j}}};
        const auto longest = *std::max_element(
            turns.begin(), turns.end(), [&](const auto& a, const auto& b) {
              return (leds.p_BL(a[1]) - leds.p_BL(a[0])).norm() <
                     (leds.p_BL(b[1]) - leds.p_BL(b[0])).norm();
            });
        const Vector3 e = leds.p_BL(longest[1]) - leds.p_BL(longest[0]);
        const Vector3 f = leds.p_BL(longest[2]) - leds.p_BL(longest[0]);
        const double area = e.cross(f).norm();
        const unsigned mask = 1u << i | 1u << j | 1u << k;
        if (area > 0.05 * e.norm() * f.norm()) all.push_back({longest, mask, area});
      }
    }
  }
  CoveringTriples out;
  std::vector<unsigned> chosen;
  const auto cover_sets_of = [&](int size) {
    std::vector<unsigned> open;
    for (unsigned set = 0; set < 1u << n; ++set) {
      if (std::popcount(set) != size) continue;
      const bool covered = std::any_of(chosen.begin(), chosen.end(),
                                       [&](unsigned t) { return (set & t) == t; });
      if (!covered) open.push_back(set);
    }
    while (!open.empty()) {
      const Entry* best = nullptr;
      std::ptrdiff_t best_count = 0;
      for (const Entry& entry : all) {
        const auto count = std::count_if(open.begin(), open.end(), [&](unsigned set) {
          return (set & entry.mask) == entry.mask;
        });
        const bool better =
            count > best_count ||
            (count == best_count && best != nullptr && entry.area > best->area);
        if (count > 0 && better) {
          best = &entry;
          best_count = count;
        }
      }
      if (best == nullptr) break;  // What is left stands in a line.
      chosen.push_back(best->mask);
      out.triples.push_back(best->triple);
      std::erase_if(open,
                    [&](unsigned set) { return (set & best->mask) == best->mask; });
    }
  };
  cover_sets_of(std::min(n, std::max(5, (3 * n + 4) / 5)));
  out.few = out.triples.size();
  cover_sets_of(std::min(n, std::max(4, (2 * n + 4) / 5)));
  return out;
}

ShapeTable::Side ShapeTable::side(const Vector2& a, const Vector2& b) {
  const Vector2 e = b - a;
  const Vector2 along = e / std::max(e.squaredNorm(), 1e-12);
  static_assert(kAngles == 4 * (std::size(kEdges) + 1));
  return {a, along, Vector2(-along.y(), along.x()), sector(e)};
}

ShapeTable::ShapeTable(const Camera& camera, const Constellation& leds,
                       double range_min_m, double range_max_m, double tilt_max,
                       const std::function<bool(const Pose&)>& allowed) {
  const CoveringTriples cover = covering_triples(leds);
  triples_ = cover.triples;
  few_ = cover.few;
  words_ = (triples_.size() + 63) / 64;
  bits_.assign(kAngles * kGrid * kGrid * words_, 0);
  const Intrinsics& lens = camera.intrinsics;
  const Pose X_CN = camera.X_NC.inverse();
  const Vector3 centre_B = leds.middle_B();
  const auto about_x = [](double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return Matrix3{{1, 0, 0}, {0, c, -s}, {0, s, c}};
  };
  const auto about_z = [](double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return Matrix3{{c, -s, 0}, {s, c, 0}, {0, 0, 1}};
  };
  // Additive recurrence: evenly spread, the same on every machine.
  double s[6] = {0.5, 0.5, 0.5, 0.5, 0.5, 0.5};
  constexpr double kStep[6] = {0.8566748838545029,  0.733891856627126,
                               0.6287067210378087,  0.5385972572236101,
                               0.46139980194318556, 0.3952665168712417};
  for (int n = 0; n < kSamples; ++n) {
    for (int k = 0; k < 6; ++k) {
      s[k] += kStep[k];
      if (s[k] >= 1) s[k] -= 1;
    }
    const double tilt = kPi / 2 * std::sqrt(s[3]);
    if (tilt > tilt_max) continue;
    const double u = s[0] * lens.width, v = s[1] * lens.height;
    const double near = std::max(range_min_m, 0.3), far = std::min(range_max_m, 3.0);
    const double range = near + (std::max(far, near) - near) * s[2] * s[2];
    const Vector3 ray_C((u - lens.cx) / lens.fx, (v - lens.cy) / lens.fy, 1);
    // Tilted about an axis in the plane that `turn` leads to, turned about its own.
    const Matrix3 turn = about_z(2 * kPi * s[4]);
    const Matrix3 R_NB = turn * about_x(tilt) * about_z(2 * kPi * (s[5] - s[4]));
    const Vector3 centre_N = camera.X_NC * Vector3(range * ray_C.normalized());
    const Pose X_NB = make_pose(R_NB, centre_N - R_NB * centre_B);
    if (!allowed(X_NB)) continue;
    const Pose X_CB = X_CN * X_NB;
    std::array<Vector2, kMaxLeds> uv;
    bool in_front = true;
    for (int i = 0; i < leds.size(); ++i) {
      const Vector3 p_CL = X_CB * leds.p_BL(i);
      in_front = in_front && p_CL.z() > 0.02;
      uv[static_cast<std::size_t>(i)] = {lens.fx * p_CL.x() / p_CL.z(),
                                         lens.fy * p_CL.y() / p_CL.z()};
    }
    if (!in_front) continue;
    for (std::size_t t = 0; t < triples_.size(); ++t) {
      const auto at = [&](int i) -> const Vector2& {
        return uv[static_cast<std::size_t>(triples_[t][static_cast<std::size_t>(i)])];
      };
      const std::size_t to = cell(side(at(0), at(1)), at(2)) * words_ + t / 64;
      bits_[to] |= std::uint64_t{1} << (t % 64);
    }
  }
  widen();
}

void ShapeTable::widen() {
  // Each cell lends its neighbours its marks, for what lies between the samples and for
  // the error of the centroids.
  const std::vector<std::uint64_t> seen = bits_;
  constexpr int kLast = static_cast<int>(kGrid) - 1;
  const auto at = [&](std::size_t i, int y, int x) {
    return ((i % kAngles * kGrid + static_cast<std::size_t>(y)) * kGrid +
            static_cast<std::size_t>(x)) *
           words_;
  };
  for (std::size_t i = 0; i < kAngles; ++i) {
    for (int y = 0; y <= kLast; ++y) {
      for (int x = 0; x <= kLast; ++x) {
        const std::size_t from = at(i, y, x);
        for (std::size_t di = kAngles - 1; di <= kAngles + 1; ++di) {
          for (int yy = std::max(y - 1, 0); yy <= std::min(y + 1, kLast); ++yy) {
            for (int xx = std::max(x - 1, 0); xx <= std::min(x + 1, kLast); ++xx) {
              const std::size_t to = at(i + di, yy, xx);
              for (std::size_t w = 0; w < words_; ++w) bits_[to + w] |= seen[from + w];
            }
          }
        }
      }
    }
  }
}

}  // namespace alight
