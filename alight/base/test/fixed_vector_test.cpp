#include "alight/base/fixed_vector.h"

#include <gtest/gtest.h>

namespace alight {
namespace {

TEST(FixedVector, RefusesWhenFull) {
  FixedVector<int, 3> v;
  EXPECT_TRUE(v.empty());
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(v.push_back(i));
  EXPECT_TRUE(v.full());
  EXPECT_FALSE(v.push_back(9));
  EXPECT_EQ(v.size(), 3u);
  EXPECT_EQ(v.back(), 2);
  EXPECT_EQ(v.capacity(), 3u);
}

TEST(FixedVector, EraseKeepsTheOrder) {
  FixedVector<int, 5> v{1, 2, 3, 4, 5};
  v.erase(0);
  v.erase(3);
  v.erase(1);
  ASSERT_EQ(v.size(), 2u);
  EXPECT_EQ(v[0], 2);
  EXPECT_EQ(v[1], 4);
}

TEST(FixedVector, TruncateClearAndReuse) {
  FixedVector<int, 4> v{1, 2, 3};
  v.truncate(1);
  EXPECT_EQ(v.size(), 1u);
  EXPECT_EQ(v.front(), 1);
  v.clear();
  EXPECT_EQ(v.begin(), v.end());
  EXPECT_TRUE(v.push_back(7));
  EXPECT_EQ(v.front(), 7);
  EXPECT_EQ(v.data(), v.begin());
}

TEST(FixedVector, RangeForSeesWhatIsThere) {
  FixedVector<int, 8> v{1, 2, 3};
  for (int& x : v) x *= 10;
  int sum = 0;
  for (const int x : v) sum += x;
  EXPECT_EQ(sum, 60);
}

TEST(FixedVector, CopiesAreApart) {
  FixedVector<int, 4> a{1, 2};
  FixedVector<int, 4> b = a;
  b[0] = 5;
  b.push_back(6);
  EXPECT_EQ(a[0], 1);
  EXPECT_EQ(a.size(), 2u);
}

/// Counts those of its kind that are alive.
struct Counted {
  Counted() { ++alive; }
  Counted(const Counted&) { ++alive; }
  Counted& operator=(const Counted&) = default;
  ~Counted() { --alive; }
  static inline int alive = 0;
};

TEST(FixedVector, HoldsNoMoreThanItSays) {
  {
    FixedVector<Counted, 8> v;
    EXPECT_EQ(Counted::alive, 0);
    for (int i = 0; i < 5; ++i) v.push_back(Counted());
    EXPECT_EQ(Counted::alive, 5);
    v.erase(1);
    EXPECT_EQ(Counted::alive, 4);
    v.truncate(3);
    EXPECT_EQ(Counted::alive, 3);
    FixedVector<Counted, 8> other = v;
    EXPECT_EQ(Counted::alive, 6);
    other.push_back(Counted());
    v = other;
    EXPECT_EQ(Counted::alive, 8);
    v = FixedVector<Counted, 8>{Counted()};
    EXPECT_EQ(Counted::alive, 5);
    const FixedVector<Counted, 8>& self = v;
    v = self;
    EXPECT_EQ(v.size(), 1u);
    v.clear();
    EXPECT_EQ(Counted::alive, 4);
  }
  EXPECT_EQ(Counted::alive, 0);
}

}  // namespace
}  // namespace alight
