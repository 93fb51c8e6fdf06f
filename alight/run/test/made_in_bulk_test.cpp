#include "alight/run/made_in_bulk.h"

#include <gtest/gtest.h>

namespace alight {
namespace {

/// Counts up to `last`, then ends or fails.
struct Numbers {
  int last = 0;
  bool fails = false;
  int made = 0, asked = 0;

  Result<bool> make(int& number) {
    ++asked;
    if (made == last && fails) return fail(Fault::io, "number 7 is torn");
    if (made == last) return false;
    number = ++made;
    return true;
  }
  MadeInBulk<int> in_bulks_of(std::size_t n) {
    return {[this](int& number) { return make(number); }, 8, 8 * n};
  }
};

TEST(MadeInBulk, EveryPictureOnceAndInOrder) {
  for (const std::size_t bulk : {1u, 2u, 3u, 7u, 50u}) {
    for (const int last : {0, 1, 6, 7, 8}) {
      Numbers numbers{.last = last};
      auto bulks = numbers.in_bulks_of(bulk);
      int number = 0;
      for (int n = 1; n <= last; ++n) {
        const auto more = bulks.next(number);
        ASSERT_TRUE(more && *more);
        EXPECT_EQ(number, n);
      }
      for (int again = 0; again < 2; ++again) {
        const auto more = bulks.next(number);
        EXPECT_TRUE(more && !*more);
        EXPECT_EQ(numbers.asked, last + 1) << "asked again after the end";
      }
    }
  }
}

TEST(MadeInBulk, SoManyAtATime) {
  Numbers numbers{.last = 10};
  auto bulks = numbers.in_bulks_of(4);
  int number = 0;
  EXPECT_EQ(numbers.made, 0);
  for (const int made : {4, 4, 4, 4, 8, 8, 8, 8, 10, 10}) {
    EXPECT_TRUE(bulks.next(number));
    EXPECT_EQ(numbers.made, made);
  }
}

TEST(MadeInBulk, OneAtATimeWherePicturesAreLargerThanTheRoom) {
  Numbers numbers{.last = 2};
  auto bulks = numbers.in_bulks_of(0);
  int number = 0;
  EXPECT_TRUE(bulks.next(number));
  EXPECT_EQ(numbers.made, 1);
}

TEST(MadeInBulk, AFailureComesInItsTurnAndStays) {
  Numbers numbers{.last = 6, .fails = true};
  auto bulks = numbers.in_bulks_of(4);
  int number = 0;
  for (int n = 1; n <= 6; ++n) {
    EXPECT_TRUE(bulks.next(number));
    EXPECT_EQ(number, n);
  }
  for (int again = 0; again < 2; ++again) {
    const auto more = bulks.next(number);
    ASSERT_FALSE(more);
    EXPECT_EQ(more.error().detail, "number 7 is torn");
    EXPECT_EQ(number, 6);
    EXPECT_EQ(numbers.asked, 7) << "asked again after a failure";
  }
}

}  // namespace
}  // namespace alight
