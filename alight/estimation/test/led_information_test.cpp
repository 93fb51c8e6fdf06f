#include "alight/estimation/led_information.h"

#include <Eigen/Cholesky>

#include "alight/estimation/test/flight.h"

namespace alight::test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kSd = 0.3;  // px

/// Places in which the filter is, with what it knows, and what it owes to each LED.
struct Place {
  Rig rig = alan_rig();
  MotionState state{Flight{}.state(0)};
  Matrix15 P = Matrix15::Zero();
  LedBias bias;

  explicit Place(Rng& rng) {
    MatrixXd A(15, 15);
    for (double& a : A.reshaped()) a = rng.normal();
    // Small, so that the picture is linear in it.
    P = 1e-8 * (A * A.transpose() + 15 * MatrixXd::Identity(15, 15));
    bias.resize(15, 3 * rig.leds.size());
    for (double& b : bias.reshaped()) b = rng.normal(0, 0.5);
  }
};

PictureMeasurement single(std::uint16_t leds, const Vector2& uv) {
  PictureMeasurement m;
  m.images.push_back({.leds = leds, .uv = uv});
  m.information = Matrix2::Identity() / (kSd * kSd);
  return m;
}

/// What the innovation tells, written with its covariance S.
LedInformation by_innovation(const Place& p, const PictureMeasurements& all) {
  const Eigen::Index n = 3 * p.rig.leds.size();
  LedInformation out{LedCovariance::Zero(n, n), LedVector::Zero(n)};
  const Pose X_NB = p.state.x.X_NB();
  Eigen::Index rows = 0;
  for (const auto& m : all) rows += 2 * static_cast<Eigen::Index>(m.images.size());
  MatrixXd H(rows, 6), G = MatrixXd::Zero(rows, n), R = MatrixXd::Zero(rows, rows);
  VectorXd v(rows);
  Eigen::Index at = 0;
  for (const auto& m : all) {
    const auto size = 2 * static_cast<Eigen::Index>(m.images.size());
    R.block(at, at, size, size) = MatrixXd(m.information).inverse();
    for (const MeasuredImage& image : m.images) {
      Matrix26 J;
      v.segment<2>(at) = image.uv - *project_observation(p.rig.camera, X_NB, p.rig.leds,
                                                         image.leds, &J);
      H.middleRows<2>(at) = J;
      for (int i = 0; i < p.rig.leds.size(); ++i) {
        if (((image.leds >> i) & 1) == 0) continue;
        // By differences: nothing here is the code's own.
        for (int c = 0; c < 3; ++c) {
          const double h = 1e-6;
          Constellation moved = p.rig.leds;
          moved.leds[static_cast<std::size_t>(i)].p_BL[c] += h;
          G.block<2, 1>(at, 3 * i + c) =
              (*project_observation(p.rig.camera, X_NB, moved, image.leds) -
               *project_observation(p.rig.camera, X_NB, p.rig.leds, image.leds)) /
              h;
        }
      }
      at += 2;
    }
  }
  G -= H * p.bias.topRows<6>();
  const MatrixXd S = H * p.P.topLeftCorner<6, 6>() * H.transpose() + R;
  const Eigen::LLT<MatrixXd> llt(S);
  out.matrix = G.transpose() * llt.solve(G);
  out.vector = G.transpose() * llt.solve(v);
  return out;
}

TEST(LedInformation, IsWhatTheInnovationTells) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE(seed);
    Rng rng(seed);
    const Place p(rng);
    const Pose X_NB = p.state.x.X_NB();
    PictureMeasurements all;
    const auto image = [&](std::uint16_t leds) -> Vector2 {
      return *project_observation(p.rig.camera, X_NB, p.rig.leds, leds) +
             Vector2(rng.normal(0, kSd), rng.normal(0, kSd));
    };
    all.push_back(single(0x01, image(0x01)));
    all.push_back(single(0x02, image(0x02)));
    all.push_back(single(0x0c, image(0x0c)));  // two in one blob
    PictureMeasurement pair = single(0x10, image(0x10));
    pair.images.push_back({.leds = 0x20, .uv = image(0x20)});
    pair.information = GroupMatrix::Identity(4, 4) / (kSd * kSd);
    pair.information(0, 2) = pair.information(2, 0) = 0.6 / (kSd * kSd);
    all.push_back(pair);

    const LedInformation expected = by_innovation(p, all);
    MotionState state = p.state;
    Matrix15 P = p.P;
    LedBias bias = p.bias;
    ASSERT_TRUE(
        map_update(p.rig.camera, p.rig.leds, all, {}, state, P, &bias).has_value());
    LedInformation told;
    ASSERT_TRUE(tell_of_leds(p.rig.camera, p.rig.leds, all, 0, state.x.X_NB(),
                             P.topLeftCorner<6, 6>(), p.bias, told));
    EXPECT_LT((told.matrix - expected.matrix).norm(), 2e-2 * expected.matrix.norm());
    EXPECT_LT((told.vector - expected.vector).norm(), 2e-2 * expected.vector.norm());
  }
}

TEST(LedInformation, AFarOutlierTellsLittle) {
  Rng rng(3);
  const Place p(rng);
  const Pose X_NB = p.state.x.X_NB();
  const auto told = [&](double off_px, double huber_sd) {
    PictureMeasurements all;
    all.push_back(single(0x01, *project_observation(p.rig.camera, X_NB, p.rig.leds, 1) +
                                   Vector2(off_px, 0)));
    LedInformation out;
    EXPECT_TRUE(tell_of_leds(p.rig.camera, p.rig.leds, all, huber_sd, X_NB,
                             p.P.topLeftCorner<6, 6>(), p.bias, out));
    return out.vector.norm();
  };
  EXPECT_NEAR(told(100, 3) / told(3 * kSd, 3), 1, 1e-9);
  EXPECT_NEAR(told(100, 0) / told(1, 0), 100, 1e-6);
}

}  // namespace
}  // namespace alight::test
