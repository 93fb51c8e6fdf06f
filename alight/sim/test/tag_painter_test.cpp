#include "alight/sim/tag_painter.h"

#include <gtest/gtest.h>

#include <cmath>

namespace alight {
namespace {

/// A rig with a tag on the nose, and a drone that shows it to the lens from `range` m.
Rig rig_with_tag(TagFamily family = TagFamily::dict_4x4_50, int id = 0) {
  Rig rig = alan_rig();
  Tag tag;
  tag.family = family;
  tag.id = id;
  tag.X_BT =
      make_pose(from_rpy(110 * kDegree, 0, 90 * kDegree), Vector3(0.06, 0, 0.035));
  rig.tag = tag;
  return rig;
}

/// X_NB with the tag's centre on the optical axis, facing the lens.
Pose facing(const Rig& rig, double range) {
  const Pose X_CT = make_pose(so3_exp(Vector3(kPi, 0, 0)), Vector3(0, 0, range));
  return rig.camera.X_NC * X_CT * rig.tag->X_BT.inverse();
}

ColorBuffer black(const Rig& rig) {
  const Intrinsics& lens = rig.camera.intrinsics;
  ColorBuffer out;
  out.clear(lens.width, lens.height);
  return out;
}

ColorBuffer paint(const Rig& rig, const CameraSimConfig& config,
                  std::span<const SceneAt> exposure) {
  ColorBuffer out = black(rig);
  TagPainter painter(config, rig, *tag_pattern(*rig.tag));
  painter.paint(RowScenes(exposure, 0, rig.camera.intrinsics.height), 1, Rng(1), out);
  return out;
}

double sum(const ColorBuffer& picture) {
  double total = 0;
  for (const std::uint8_t byte : picture.pixels()) total += byte;
  return total / 3;
}

CameraSimConfig quiet() {
  CameraSimConfig config;
  config.noise = 0;
  config.tag_white = 200;
  return config;
}

TEST(TagPattern, HasAWhiteRimABlackBorderAndDiffersFromTagToTag) {
  for (const TagFamily family : {TagFamily::dict_4x4_50, TagFamily::tag36h11}) {
    std::vector<std::vector<bool>> seen;
    for (int id = 0; id < 50; ++id) {
      const auto pattern = tag_pattern(*rig_with_tag(family, id).tag);
      ASSERT_TRUE(pattern);
      const int last = pattern->cells - 1;
      for (int k = 0; k <= last; ++k) {
        for (const auto& [r, c] : {std::pair{0, k}, {last, k}, {k, 0}, {k, last}}) {
          EXPECT_TRUE(pattern->at(r, c));
        }
        if (k == 0 || k == last) continue;
        for (const auto& [r, c] :
             {std::pair{1, k}, {last - 1, k}, {k, 1}, {k, last - 1}}) {
          EXPECT_FALSE(pattern->at(r, c));
        }
      }
      for (const auto& other : seen) EXPECT_NE(other, pattern->white);
      seen.push_back(pattern->white);
    }
    const auto beyond = tag_pattern(*rig_with_tag(family, 50).tag);
    ASSERT_FALSE(beyond);
    EXPECT_NE(beyond.error().detail.find("tag.id is 50"), std::string::npos);
  }
}

TEST(TagPainter, LightFollowsTheSquareOfTheDistance) {
  const Rig rig = rig_with_tag();
  const SceneAt near{Pose::Identity(), facing(rig, 0.5)};
  const SceneAt far{Pose::Identity(), facing(rig, 1.0)};
  const double a = sum(paint(rig, quiet(), {&near, 1}));
  const double b = sum(paint(rig, quiet(), {&far, 1}));
  EXPECT_NEAR(a / b, 4, 0.1);
}

TEST(TagPainter, HalfAPixelAsideIsHalfAPixelAside) {
  const Rig rig = rig_with_tag();
  const auto centroid = [&](double shift_px) {
    Pose X_NB = facing(rig, 0.6);
    const double metres = shift_px * 0.6 / rig.camera.intrinsics.fx;
    X_NB.translation() += rig.camera.X_NC.linear() * Vector3(metres, 0, 0);
    const SceneAt scene{Pose::Identity(), X_NB};
    const ColorBuffer out = paint(rig, quiet(), {&scene, 1});
    double light = 0, first = 0;
    for (int v = 0; v < out.height; ++v) {
      for (int u = 0; u < out.width; ++u) {
        const double grey = out.view().row(v)[3 * u];
        light += grey;
        first += grey * u;
      }
    }
    return first / light;
  };
  const double still = centroid(0);
  EXPECT_NEAR(centroid(0.5) - still, 0.5, 0.06);
  EXPECT_NEAR(centroid(3) - still, 3, 0.06);
}

TEST(TagPainter, MotionSmearsButKeepsTheLight) {
  const Rig rig = rig_with_tag();
  Pose ahead = facing(rig, 0.6), behind = ahead;
  ahead.translation() += rig.camera.X_NC.linear() * Vector3(0.006, 0, 0);
  behind.translation() -= rig.camera.X_NC.linear() * Vector3(0.006, 0, 0);
  const SceneAt moving[2] = {{Pose::Identity(), behind}, {Pose::Identity(), ahead}};
  const SceneAt still{Pose::Identity(), facing(rig, 0.6)};
  const ColorBuffer smeared = paint(rig, quiet(), moving);
  const ColorBuffer sharp = paint(rig, quiet(), {&still, 1});
  EXPECT_NEAR(sum(smeared) / sum(sharp), 1, 0.02);
  const auto contrast = [](const ColorBuffer& out) {
    double square = 0;
    for (int v = 0; v < out.height; ++v) {
      const std::uint8_t* row = out.view().row(v);
      for (int u = 1; u < out.width; ++u) {
        square += std::pow(row[3 * u] - row[3 * u - 3], 2);
      }
    }
    return square;
  };
  EXPECT_LT(contrast(smeared), 0.6 * contrast(sharp));
}

TEST(TagPainter, IsSeenFromItsFrontOnlyAndNotThroughThePad) {
  const Rig rig = rig_with_tag();
  const Pose front = facing(rig, 0.6);
  const SceneAt turned{Pose::Identity(),
                       front * make_pose(from_rpy(0, 0, kPi), Vector3::Zero())};
  EXPECT_EQ(sum(paint(rig, quiet(), {&turned, 1})), 0);
  const SceneAt behind_lens{Pose::Identity(), facing(rig, -0.6)};
  EXPECT_EQ(sum(paint(rig, quiet(), {&behind_lens, 1})), 0);
  Rig walled = rig;
  // A wall between lens and tag.
  const Vector3 half_way =
      0.5 * (rig.camera.X_NC.translation() + (front * rig.tag->X_BT).translation());
  walled.pad.obstacles = {
      {half_way - Vector3(0.02, 0.1, 0.1), half_way + Vector3(0.02, 0.1, 0.1)}};
  const SceneAt scene{Pose::Identity(), front};
  EXPECT_GT(sum(paint(rig, quiet(), {&scene, 1})), 0);
  EXPECT_EQ(sum(paint(walled, quiet(), {&scene, 1})), 0);
}

TEST(TagPainter, ARigWithoutATagRendersAsBefore) {
  const Rig plain = alan_rig();
  Rig tagged = rig_with_tag();
  auto one = CameraRenderer::create({}, plain, 3);
  auto other = CameraRenderer::create({}, tagged, 3);
  ASSERT_TRUE(one && other);
  // Turned away: what differs is the tag alone.
  const SceneAt away{Pose::Identity(),
                     make_pose(from_rpy(0, 0, kPi), Vector3(-0.8, 0, 0.6))};
  const SceneAt shown{Pose::Identity(), facing(tagged, 0.8)};
  ColorBuffer a, b;
  ASSERT_TRUE(one->render(5, {&away, 1}, a));
  ASSERT_TRUE(other->render(5, {&away, 1}, b));
  EXPECT_EQ(a.pixels(), b.pixels());
  ASSERT_TRUE(one->render(6, {&shown, 1}, a));
  ASSERT_TRUE(other->render(6, {&shown, 1}, b));
  EXPECT_NE(a.pixels(), b.pixels());
  tagged.tag->id = 49;
  EXPECT_TRUE(CameraRenderer::create({}, tagged, 3));
  tagged.tag->family = TagFamily::tag36h11;
  tagged.tag->id = 100;
  EXPECT_FALSE(CameraRenderer::create({}, tagged, 3));
}

}  // namespace
}  // namespace alight
