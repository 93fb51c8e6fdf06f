#include "alight/estimation/map_update.h"

#include <gtest/gtest.h>

#include "alight/estimation/test/flight.h"

namespace alight::test {
namespace {

PictureMeasurement measured(const LedObservation& o) {
  PictureMeasurement m;
  m.images.push_back({.leds = o.leds, .uv = o.uv});
  m.information = o.cov.inverse();
  return m;
}

PictureMeasurements measurements_of(const LedFrame& frame) {
  PictureMeasurements out;
  for (const auto& o : frame.seen) out.push_back(measured(o));
  return out;
}

Matrix15 prior_covariance(Rng& rng) {
  Matrix15 L = Matrix15::Zero();
  const double sd[5] = {0.02, 0.05, 0.2, 0.5, 0.4};
  for (int i = 0; i < 15; ++i) {
    for (int j = 0; j <= i; ++j) {
      L(i, j) = (i == j ? 1 : 0.3 * rng.normal()) * sd[i / 3];
    }
  }
  return L * L.transpose();
}

struct Case {
  Rig rig = alan_rig();
  MotionState prior, truth;
  Matrix15 P;
  PictureMeasurements measurements;

  explicit Case(std::uint64_t seed) {
    Rng rng(seed);
    prior.x = Flight{}.state(rng.uniform(0, 5));
    P = prior_covariance(rng);
    Vector15 white;
    for (int i = 0; i < 15; ++i) white[i] = rng.normal();
    truth = boxplus(prior, Vector15(P.llt().matrixL() * white));
    measurements =
        measurements_of(picture(rig.camera, rig.leds, truth.x.X_NB(), 0, 0.3, rng));
  }

  double cost(const MotionState& s, const MapUpdateOptions& options) const {
    const Vector15 e = boxminus(s, prior);
    double sum = e.dot(P.llt().solve(e));
    for (const auto& m : measurements) {
      Eigen::VectorXd r(2 * static_cast<Eigen::Index>(m.images.size()));
      Eigen::Index at = 0;
      for (const MeasuredImage& image : m.images) {
        r.segment<2>(at) = image.uv - *project_observation(rig.camera, s.x.X_NB(),
                                                           rig.leds, image.leds);
        at += 2;
        if (image.depth_variance > 0) {
          const double r_z = image.depth_m - predicted_depth(rig.camera, s.x.X_NB(),
                                                             rig.leds, image.leds);
          sum += r_z * r_z / image.depth_variance;
        }
      }
      sum += r.dot(m.information * r);
    }
    if (options.velocity_variance > 0) {
      sum += (s.x.v_NB - options.v_NB).squaredNorm() / options.velocity_variance;
    }
    return sum;
  }
};

// The answer is the minimum over all fifteen components, though fewer are iterated.
TEST(MapUpdate, FindsTheMinimumOfTheWholeCost) {
  for (const double velocity_variance : {0.0, 0.04}) {
    for (std::uint64_t seed = 0; seed < 30; ++seed) {
      Case c(seed);
      for (auto& m : c.measurements) {
        MeasuredImage& image = m.images[0];
        image.depth_m =
            predicted_depth(c.rig.camera, c.truth.x.X_NB(), c.rig.leds, image.leds);
        image.depth_variance = 1e-3;
      }
      const MapUpdateOptions options{.max_iterations = 50,
                                     .tolerance = 1e-10,
                                     .velocity_variance = velocity_variance,
                                     .v_NB = c.truth.x.v_NB};
      MotionState s = c.prior;
      Matrix15 P = c.P;
      const auto done =
          map_update(c.rig.camera, c.rig.leds, c.measurements, options, s, P, nullptr);
      ASSERT_TRUE(done.has_value());
      EXPECT_TRUE(done->converged);
      const double h = 1e-6;
      for (int i = 0; i < 15; ++i) {
        const double slope =
            (c.cost(boxplus(s, Vector15(h * Vector15::Unit(i))), options) -
             c.cost(boxplus(s, Vector15(-h * Vector15::Unit(i))), options)) /
            (2 * h);
        // In units of the posterior's standard deviation.
        EXPECT_NEAR(slope * std::sqrt(P(i, i)), 0, 1e-4) << "component " << i;
      }
    }
  }
}

// Joseph's form at the solution is the inverse of the whole information matrix.
TEST(MapUpdate, CovarianceIsTheInverseInformation) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Case c(seed);
    MotionState s = c.prior;
    Matrix15 P = c.P;
    const MapUpdateOptions options{.max_iterations = 50, .tolerance = 1e-10};
    ASSERT_TRUE(
        map_update(c.rig.camera, c.rig.leds, c.measurements, options, s, P, nullptr)
            .has_value());
    const Vector15 e = boxminus(s, c.prior);
    Matrix15 J = Matrix15::Identity();
    J.block<3, 3>(3, 3) = so3_right_jacobian_inverse(e.segment<3>(3));
    Matrix15 A = J.transpose() * c.P.inverse() * J;
    for (const auto& m : c.measurements) {
      Matrix26 H;
      (void)project_observation(c.rig.camera, s.x.X_NB(), c.rig.leds, m.images[0].leds,
                                &H);
      A.topLeftCorner<6, 6>() += H.transpose() * m.information * H;
    }
    EXPECT_LT((P * A - Matrix15::Identity()).norm(), 1e-6);
    EXPECT_EQ(P, P.transpose());
  }
}

TEST(MapUpdate, MoreCertaintyNeverLess) {
  const Case c(7);
  MotionState s = c.prior;
  Matrix15 P = c.P;
  ASSERT_TRUE(map_update(c.rig.camera, c.rig.leds, c.measurements, {}, s, P, nullptr)
                  .has_value());
  for (int i = 0; i < 15; ++i) EXPECT_LE(P(i, i), 1.05 * c.P(i, i));
}

// The predicted response to a displaced LED is the one seen when it is displaced.
TEST(MapUpdate, LedBiasAgreesWithDifferences) {
  Case c(3);
  // Without residuals, for Gauss-Newton leaves out their curvature.
  c.truth = c.prior;
  for (auto& m : c.measurements) {
    MeasuredImage& image = m.images[0];
    image.uv =
        *project_observation(c.rig.camera, c.truth.x.X_NB(), c.rig.leds, image.leds);
  }
  const MapUpdateOptions options{.max_iterations = 50, .tolerance = 1e-12};
  LedBias bias;
  bias.setZero(15, 3 * c.rig.leds.size());
  MotionState s = c.prior;
  Matrix15 P = c.P;
  ASSERT_TRUE(map_update(c.rig.camera, c.rig.leds, c.measurements, options, s, P, &bias)
                  .has_value());
  const double h = 1e-5;
  for (int k = 0; k < c.rig.leds.size(); ++k) {
    for (int axis = 0; axis < 3; ++axis) {
      // The truth displaced by +h: the picture moves as if the LED had.
      auto measurements = c.measurements;
      const Vector3 p_BL = c.rig.leds.p_BL(k);
      const Vector2 shift =
          *project_led(c.rig.camera, s.x.X_NB(), p_BL + h * Vector3::Unit(axis)) -
          *project_led(c.rig.camera, s.x.X_NB(), p_BL);
      for (auto& m : measurements) {
        if (m.images[0].leds == (1u << k)) m.images[0].uv += shift;
      }
      MotionState moved = c.prior;
      Matrix15 P_moved = c.P;
      ASSERT_TRUE(map_update(c.rig.camera, c.rig.leds, measurements, options, moved,
                             P_moved, nullptr)
                      .has_value());
      const Vector15 seen = boxminus(moved, s) / h;
      const Vector15 said = bias.col(3 * k + axis);
      EXPECT_LT((seen - said).norm(), 1e-3 * std::max(1.0, said.norm()));
    }
  }
}

TEST(MapUpdate, MergedLedsMeasureTheirMean) {
  Case c(5);
  PictureMeasurements merged;
  merged.push_back(measured(
      {.leds = 0b000110,
       .uv = *project_observation(c.rig.camera, c.truth.x.X_NB(), c.rig.leds, 0b000110),
       .cov = 0.01 * Matrix2::Identity()}));
  for (const auto& m : c.measurements) {
    if ((m.images[0].leds & 0b000110) == 0) merged.push_back(m);
  }
  MotionState s = c.prior;
  Matrix15 P = c.P;
  ASSERT_TRUE(
      map_update(c.rig.camera, c.rig.leds, merged, {}, s, P, nullptr).has_value());
  EXPECT_LT(boxminus(s.x, c.truth.x).head<3>().norm(),
            boxminus(c.prior.x, c.truth.x).head<3>().norm());
}

PictureMeasurement together(const PictureMeasurements& singles, std::size_t first,
                            std::size_t count) {
  PictureMeasurement group;
  const auto rows = static_cast<Eigen::Index>(2 * count);
  group.information = GroupMatrix::Zero(rows, rows);
  for (std::size_t k = 0; k < count; ++k) {
    const auto at = static_cast<Eigen::Index>(2 * k);
    group.images.push_back(singles[first + k].images[0]);
    group.information.block<2, 2>(at, at) = singles[first + k].information;
  }
  return group;
}

TEST(MapUpdate, ImagesMeasuredTogetherButUnrelatedAreTheSameAsOneByOne) {
  const Case c(7);
  ASSERT_EQ(c.measurements.size(), 6u);
  MotionState one = c.prior;
  Matrix15 P_one = c.P;
  LedBias bias_one = LedBias::Zero(15, 18);
  ASSERT_TRUE(
      map_update(c.rig.camera, c.rig.leds, c.measurements, {}, one, P_one, &bias_one));
  for (std::size_t count = 2; count <= kMaxGroup; ++count) {
    PictureMeasurements grouped;
    grouped.push_back(together(c.measurements, 0, count));
    for (std::size_t i = count; i < 6; ++i) grouped.push_back(c.measurements[i]);
    MotionState s = c.prior;
    Matrix15 P = c.P;
    LedBias bias = LedBias::Zero(15, 18);
    ASSERT_TRUE(map_update(c.rig.camera, c.rig.leds, grouped, {}, s, P, &bias));
    EXPECT_LT(boxminus(s, one).norm(), 1e-9);
    EXPECT_LT((P - P_one).norm(), 1e-9);
    EXPECT_LT((bias - bias_one).norm(), 1e-9);
  }
}

TEST(MapUpdate, ADirectionWithoutInformationIsNoMeasurement) {
  Case c(8);
  PictureMeasurements open;
  open.push_back(together(c.measurements, 0, 2));
  for (std::size_t i = 2; i < 6; ++i) open.push_back(c.measurements[i]);
  // Only the mean of the two is known: what each says of the difference is nothing.
  Eigen::Matrix<double, 2, 4> mean;
  mean << 0.5, 0, 0.5, 0, 0, 0.5, 0, 0.5;
  open[0].information = mean.transpose() * mean * 100;
  PictureMeasurements moved = open;
  moved[0].images[0].uv += Vector2(3, -2);
  moved[0].images[1].uv -= Vector2(3, -2);
  MotionState s = c.prior, s_moved = c.prior;
  Matrix15 P = c.P, P_moved = c.P;
  ASSERT_TRUE(map_update(c.rig.camera, c.rig.leds, open, {}, s, P, nullptr));
  ASSERT_TRUE(
      map_update(c.rig.camera, c.rig.leds, moved, {}, s_moved, P_moved, nullptr));
  EXPECT_LT(boxminus(s, s_moved).norm(), 1e-9);
}

TEST(MapUpdate, FailureChangesNothing) {
  Case c(2);
  const Matrix15 P_before = c.P;
  // Behind the lens.
  c.prior.x.p_NB = c.rig.camera.X_NC * Vector3(0, 0, -2);
  MotionState s = c.prior;
  EXPECT_FALSE(map_update(c.rig.camera, c.rig.leds, c.measurements, {}, s, c.P, nullptr)
                   .has_value());
  EXPECT_EQ(boxminus(s, c.prior).norm(), 0);
  EXPECT_EQ(c.P, P_before);

  Case d(2);
  Matrix15 indefinite = -d.P;
  EXPECT_FALSE(map_update(d.rig.camera, d.rig.leds, d.measurements, {}, d.prior,
                          indefinite, nullptr)
                   .has_value());
}

}  // namespace
}  // namespace alight::test
