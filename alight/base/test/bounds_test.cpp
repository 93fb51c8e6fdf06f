#include "alight/base/bounds.h"

#include <gtest/gtest.h>

#include <limits>

namespace alight {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(Bounds, HoldAtBothEndsAndBetween) {
  EXPECT_TRUE(check_bounds({}));
  EXPECT_TRUE(check_bounds({{"a", 1, 1, 2}, {"b", 2, 1, 2}, {"c", 1.5, 1, 2}}));
}

TEST(Bounds, NameTheFirstThatDoesNotHoldItsValueAndItsEnds) {
  const auto checked =
      check_bounds({{"good", 0, -1, 1}, {"loss", 2.5, 0, 1}, {"later", 9, 0, 1}});
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().fault, Fault::invalid_config);
  EXPECT_EQ(checked.error().detail, "loss is 2.5, must lie in [0, 1]");
}

TEST(Bounds, RefuseWhatIsNoNumberOrWithoutEnd) {
  for (const double wrong :
       {std::numeric_limits<double>::quiet_NaN(), kInfinity, -kInfinity, 1 + 1e-12}) {
    EXPECT_FALSE(check_bounds({{"a", wrong, 0, 1}})) << wrong;
  }
}

TEST(FirstComplaint, KeepsTheFirst) {
  FirstComplaint check;
  EXPECT_TRUE(check.result());
  check.that(true, "holds");
  check.range("a", 0.5, 0, 1);
  EXPECT_TRUE(check.result());
  check.that(false, "that is wrong");
  check.range("a", 7, 0, 1);
  ASSERT_FALSE(check.result());
  EXPECT_EQ(check.result().error().detail, "that is wrong");
}

}  // namespace
}  // namespace alight
