#include "alight/vision/pad_mirror.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alight/base/rng.h"
#include "alight/geometry/rig.h"

namespace alight {
namespace {

/// A light above the pad, and its mirror point: images by the true camera.
struct Pair {
  Vector2 light, image;
};

/// Draws lights until both images are in the picture and the point of the pad that
/// reflects lies on it.
Pair draw(const Camera& camera, double half_pad, Rng& rng) {
  const Pose X_CN = camera.X_NC.inverse();
  for (;;) {
    const Vector3 light(rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3),
                        rng.uniform(0.005, 0.3));
    const Vector3 image(light.x(), light.y(), -light.z());
    const Vector3 lens = camera.X_NC.translation();
    const double share = lens.z() / (lens.z() + light.z());
    const Vector3 on_pad = lens + share * (image - lens);
    if (on_pad.head<2>().cwiseAbs().maxCoeff() > half_pad) continue;
    const auto uv = camera.intrinsics.project(X_CN * light);
    const auto twin = camera.intrinsics.project(X_CN * image);
    if (!uv || !twin || !camera.intrinsics.contains(*uv) ||
        !camera.intrinsics.contains(*twin)) {
      continue;
    }
    return {*uv, *twin};
  }
}

/// The camera as it is mounted in truth: turned by up to 1 deg about any axis.
Camera turned(const Camera& camera, Rng& rng) {
  Camera out = camera;
  const Vector3 axis = Vector3(rng.normal(), rng.normal(), rng.normal()).normalized();
  out.X_NC.linear() = out.X_NC.linear() * so3_exp(rng.uniform(0, 1) * kDegree * axis);
  return out;
}

constexpr double kPad = 0.43;

TEST(PadMirror, KnowsALightsImageThoughTheMountIsOff) {
  const Rig rig = alan_rig();
  const PadMirror mirror(rig.camera, kPad);
  int missed = 0, swapped = 0, apart = 0;
  constexpr int kPairs = 2000;
  for (unsigned seed = 0; seed < kPairs; ++seed) {
    Rng rng(seed);
    const Pair exact = draw(rig.camera, kPad / 2, rng);
    EXPECT_TRUE(mirror.may_mirror(exact.light, exact.image)) << "seed " << seed;
    const Pair seen = draw(turned(rig.camera, rng), kPad / 2, rng);
    missed += !mirror.may_mirror(seen.light, seen.image);
    // A light does not mirror its image. Closer than this the two are one patch.
    if ((seen.light - seen.image).norm() < 4) continue;
    ++apart;
    swapped += mirror.may_mirror(seen.image, seen.light);
  }
  EXPECT_EQ(swapped, 0);
  EXPECT_GT(apart, 0.9 * kPairs);
  // At the pad's side edges a mount that is off takes some out of what is looked at.
  EXPECT_LE(missed, 0.015 * kPairs);
}

TEST(PadMirror, WithinThePadsMiddleNoneIsMissed) {
  const Rig rig = alan_rig();
  const PadMirror mirror(rig.camera, kPad);
  for (unsigned seed = 0; seed < 2000; ++seed) {
    Rng rng(seed);
    const Pair seen = draw(turned(rig.camera, rng), 0.6 * kPad / 2, rng);
    EXPECT_TRUE(mirror.may_mirror(seen.light, seen.image)) << "seed " << seed;
  }
}

// LEDs a centimetre above the pad, seen flatly: by a mount 1.8 deg and 1 cm off their
// twins lie 2 m away.
TEST(PadMirror, KnowsTheTwinsOfADroneAtRestThatIsSeenFlatly) {
  const Rig rig = alan_rig();
  const PadMirror mirror(rig.camera, kPad);
  Camera camera = rig.camera;
  camera.X_NC.translation().z() -= 0.01;
  camera.X_NC.linear() =
      camera.X_NC.linear() * so3_exp(-1.8 * kDegree * Vector3::UnitX());
  const Pose X_CN = camera.X_NC.inverse();
  int seen = 0, missed = 0;
  for (unsigned seed = 0; seed < 1000; ++seed) {
    Rng rng(seed);
    const Vector3 light(rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1),
                        rng.uniform(0.008, 0.012));
    const auto uv = camera.intrinsics.project(X_CN * light);
    const auto twin =
        camera.intrinsics.project(X_CN * Vector3(light.x(), light.y(), -light.z()));
    ASSERT_TRUE(uv && twin);
    const Vector3 ray =
        rig.camera.X_NC.linear() * rig.camera.intrinsics.unproject(*twin);
    if (ray.z() > -0.002) continue;  // as if it were above the horizon
    ++seen;
    missed += !mirror.may_mirror(*uv, *twin);
    EXPECT_FALSE(mirror.may_mirror(*twin, *uv)) << "seed " << seed;
  }
  EXPECT_GT(seen, 800);
  // The farthest of them: light and twin then go up alike, to who knows what height.
  EXPECT_LE(missed, 0.05 * seen);
}

TEST(PadMirror, APadOfNoSizeShowsNothing) {
  const Rig rig = alan_rig();
  const PadMirror none(rig.camera, 0);
  for (unsigned seed = 0; seed < 300; ++seed) {
    Rng rng(seed);
    const Pair seen = draw(rig.camera, kPad / 2, rng);
    EXPECT_FALSE(none.shows(seen.image));
    EXPECT_FALSE(none.may_mirror(seen.light, seen.image));
  }
}

TEST(PadMirror, ALightToTheSideIsNotMirroredThere) {
  const Rig rig = alan_rig();
  const PadMirror mirror(rig.camera, kPad);
  for (unsigned seed = 0; seed < 1000; ++seed) {
    Rng rng(seed);
    const Pair seen = draw(rig.camera, kPad / 2, rng);
    const double apart = (seen.light - seen.image).norm();
    const Vector2 along = (seen.light - seen.image).normalized();
    const Vector2 across(-along.y(), along.x());
    const double far =
        (rng.chance(0.5) ? 1 : -1) * (6 + 0.2 * apart + rng.uniform(0, 60));
    EXPECT_FALSE(mirror.may_mirror(seen.light + far * across, seen.image))
        << "seed " << seed << ", " << far << " px aside";
  }
}

// Whatever stands there: what is not seen on the pad is no mirror image.
TEST(PadMirror, NothingIsMirroredOutsideThePad) {
  const Rig rig = alan_rig();
  const PadMirror mirror(rig.camera, kPad);
  const Vector3 lens = rig.camera.X_NC.translation();
  int outside = 0, on_it = 0;
  for (unsigned seed = 0; seed < 5000; ++seed) {
    Rng rng(seed);
    const Vector2 uv(rng.uniform(0, 847), rng.uniform(0, 479));
    const Vector2 light(rng.uniform(0, 847), rng.uniform(0, 479));
    // Angle to the nearest point of the pad, which is sampled at every 21 mm.
    const Vector3 ray =
        (rig.camera.X_NC.linear() * rig.camera.intrinsics.unproject(uv)).normalized();
    double nearest = kPi;
    for (int i = 0; i <= 20; ++i) {
      for (int j = 0; j <= 20; ++j) {
        const Vector3 p((i / 20.0 - 0.5) * kPad, (j / 20.0 - 0.5) * kPad, 0);
        nearest = std::min(nearest, std::acos(std::clamp(
                                        ray.dot((p - lens).normalized()), -1.0, 1.0)));
      }
    }
    if (nearest > 4 * kDegree) {
      ++outside;
      EXPECT_FALSE(mirror.shows(uv)) << uv.transpose();
      EXPECT_FALSE(mirror.may_mirror(light, uv));
    }
    on_it += mirror.shows(uv);
  }
  EXPECT_GT(outside, 1000);
  EXPECT_GT(on_it, 100);
}

TEST(PadMirror, ALensBelowThePadSeesNoMirror) {
  Rig rig = alan_rig();
  Rng rng(1);
  const Pair seen = draw(rig.camera, kPad / 2, rng);
  rig.camera.X_NC.translation().z() = -0.05;
  EXPECT_FALSE(PadMirror(rig.camera, kPad).shows(seen.image));
}

}  // namespace
}  // namespace alight
