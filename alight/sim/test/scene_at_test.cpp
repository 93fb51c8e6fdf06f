#include "alight/sim/scene_at.h"

#include <gtest/gtest.h>

#include <optional>
#include <vector>

namespace alight {
namespace {

CameraTiming timing(double exposure_ms, double readout_ms) {
  CameraTiming t;
  t.exposure_ms = exposure_ms;
  t.readout_ms = readout_ms;
  return t;
}

/// Instants of what moves by 1 m/s along x, from -span/2 to span/2.
std::vector<SceneAt> instants(Seconds span, int count) {
  std::vector<SceneAt> out(static_cast<std::size_t>(count));
  for (int k = 0; k < count; ++k) {
    const double share = count > 1 ? k / (count - 1.0) - 0.5 : 0;
    out[static_cast<std::size_t>(k)].X_NB.translation().x() = share * span;
  }
  return out;
}

double when(const SceneAt& scene) { return scene.X_NB.translation().x(); }

TEST(SceneAt, AnExposureEndsBeforeTheNextPicture) {
  EXPECT_DOUBLE_EQ(exposure_of(timing(2, 0)), 0.002);
  EXPECT_DOUBLE_EQ(exposure_of(timing(2, 0), 100), 1.0 / 60);
  EXPECT_DOUBLE_EQ(span_of(timing(2, 10)), 0.012);
}

TEST(RowScenes, AGlobalShutterSeesAllInstantsInEveryRow) {
  const std::vector<SceneAt> all = instants(0.002, 5);
  const RowScenes scenes(all, 0, 480);
  RowScenes::Instants room;
  EXPECT_EQ(scenes.of_row(3, room).data(), all.data());
  EXPECT_EQ(scenes.of_row(3, room).size(), all.size());
}

TEST(RowScenes, RowsAreExposedOneAfterTheOther) {
  const CameraTiming t = timing(2, 10);
  for (const int count : {2, 5, 7, 8}) {
    const std::vector<SceneAt> all = instants(span_of(t), count);
    const RowScenes scenes(all, 10.0 / 12, 480);
    for (const double v : {0.0, 100.0, 239.5, 479.0}) {
      RowScenes::Instants room;
      const auto seen = scenes.of_row(v, room);
      ASSERT_EQ(seen.size(), 3u);
      const double middle = 0.010 * (v / 479 - 0.5);
      EXPECT_NEAR(when(seen[0]), middle - 0.001, 1e-12);
      EXPECT_NEAR(when(seen[1]), middle, 1e-12);
      EXPECT_NEAR(when(seen[2]), middle + 0.001, 1e-12);
    }
  }
}

TEST(RowScenes, WhatMovesAcrossRowsIsSeenWhereItsRowMeetsIt) {
  const CameraTiming t = timing(2, 16);
  const std::vector<SceneAt> all = instants(span_of(t), 7);
  const RowScenes scenes(all, 16.0 / 18, 480);
  // Down the picture by 3000 px/s, a tenth of the readout's pace, from row 100.
  const auto image = [](const SceneAt& s) {
    return std::optional(Vector2(0, 100 + 3000 * when(s)));
  };
  RowScenes::Instants room;
  const auto seen = scenes.where_seen(image, room);
  const double at = when(seen[1]);
  EXPECT_NEAR(at, 0.016 * ((100 + 3000 * at) / 479 - 0.5), 2e-6);
  const auto nowhere = [](const SceneAt&) -> std::optional<Vector2> { return {}; };
  EXPECT_NEAR(when(scenes.where_seen(nowhere, room)[1]), 0, 1e-12);
}

}  // namespace
}  // namespace alight
