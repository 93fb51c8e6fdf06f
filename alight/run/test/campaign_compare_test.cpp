#include "alight/run/campaign_compare.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alight/base/rng.h"
#include "alight/run/campaign_store.h"
#include "run_scenarios.h"

namespace alight {
namespace {

TEST(PairedShare, McNemarsPIsThatOfACoin) {
  // By hand: 2 (1 + 6) / 64 for 1 against 5, and so on.
  EXPECT_NEAR(paired_share(10, 1, 5, 0).p, 14.0 / 64, 1e-12);
  EXPECT_NEAR(paired_share(3, 0, 10, 7).p, 2.0 / 1024, 1e-12);
  EXPECT_EQ(paired_share(3, 4, 4, 7).p, 1);
  EXPECT_EQ(paired_share(100, 0, 0, 3).p, 1);
  // What both or neither did says nothing of the difference.
  EXPECT_EQ(paired_share(0, 2, 9, 0).p, paired_share(500, 2, 9, 40).p);
}

TEST(PairedShare, SidesSwapAsTheyShould) {
  const PairedShare a = paired_share(50, 3, 11, 6), b = paired_share(50, 11, 3, 6);
  EXPECT_EQ(a.p, b.p);
  EXPECT_NEAR(a.difference, 8.0 / 70, 1e-12);
  EXPECT_NEAR(a.difference, -b.difference, 1e-12);
  EXPECT_NEAR(a.interval.low, -b.interval.high, 1e-12);
  EXPECT_LT(a.interval.low, a.difference);
  EXPECT_GT(a.interval.high, a.difference);
}

TEST(PairedShare, TheIntervalHoldsTheTruthNineteenTimesInTwenty) {
  Rng rng(5);
  int held = 0;
  const int trials = 2000;
  for (int trial = 0; trial < trials; ++trial) {
    int count[4] = {0, 0, 0, 0};
    for (int k = 0; k < 80; ++k) {
      const double u = rng.uniform();  // both 0.8, only A 0.03, only B 0.1
      ++count[u < 0.8 ? 0 : u < 0.83 ? 1 : u < 0.93 ? 2 : 3];
    }
    const PairedShare s = paired_share(count[0], count[1], count[2], count[3]);
    held += s.interval.low <= 0.07 && 0.07 <= s.interval.high;
  }
  EXPECT_NEAR(held / static_cast<double>(trials), 0.95, 0.025);
}

TEST(PairedMedian, TheIntervalHoldsTheTruthWhateverTheDistribution) {
  Rng rng(6);
  for (const int n : {6, 15, 60}) {
    int held = 0;
    const int trials = 2000;
    for (int trial = 0; trial < trials; ++trial) {
      std::vector<double> values;  // heavy tails about 3
      for (int k = 0; k < n; ++k) values.push_back(3 + rng.normal() / rng.normal());
      const PairedMedian m = paired_median(values);
      held += m.interval.low <= 3 && 3 <= m.interval.high;
    }
    EXPECT_GE(held / static_cast<double>(trials), 0.94) << n;
  }
  EXPECT_TRUE(std::isnan(paired_median({1, 2, 3, 4, 5}).interval.low));
  EXPECT_EQ(paired_median({1, 2, 3, 4, 5}).median, 3);
}

/// A store of made-up landings.
class Stores : public testing::Test {
 protected:
  void put(const std::string& file, const std::string& scenario, std::uint64_t seed,
           Outcome outcome, double error_m, const std::string& profile = "default",
           const std::string& version = "1") {
    auto store = CampaignStore::open(folder_.file(file));
    ASSERT_TRUE(store) << store.error().detail;
    LandingResult r;
    r.outcome = outcome;
    r.touchdown = LandingResult::Touchdown{10, error_m, 0.2, 2, 1};
    const CampaignKey key{scenario, "h", "r", profile, seed, 60, true, version};
    ASSERT_TRUE(store->insert(key, r));
  }
  CampaignSide side(const std::string& file) const {
    return {.store = folder_.file(file)};
  }
  test::Folder folder_;
};

TEST_F(Stores, PairsByScenarioAndSeed) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    put("a.sqlite", "circle", seed, seed == 1 ? Outcome::crashed : Outcome::landed,
        0.03);
    put("b.sqlite", "circle", seed + 1, Outcome::landed, 0.02);
  }
  put("a.sqlite", "block", 1, Outcome::landed, 0.1);
  const auto all = compare_campaigns(side("a.sqlite"), side("b.sqlite"));
  ASSERT_TRUE(all) << all.error().detail;
  ASSERT_EQ(all->size(), 1u);
  const CampaignComparison& c = all->front();
  EXPECT_EQ(c.landed.pairs(), 7);
  EXPECT_EQ(c.landed.both, 7);
  EXPECT_EQ(c.first_try.neither, 7);  // none of these says that it tried
  EXPECT_EQ(c.crashed.neither, 7);
  EXPECT_EQ(c.alone_a, 1);
  EXPECT_EQ(c.alone_b, 1);
  EXPECT_EQ(c.figures[0].pairs, 7);
  EXPECT_NEAR(c.figures[0].difference, -1, 1e-9);  // cm
  EXPECT_NE(comparison_text(*all).find("circle: 7 pairs"), std::string::npos);
}

TEST_F(Stores, OneStoreHoldsBothWhenTold) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    put("a.sqlite", "circle", seed, Outcome::landed, 0.02, "default");
    put("a.sqlite", "circle", seed, Outcome::crashed, 0.05, "paper");
  }
  const auto mixed = compare_campaigns(side("a.sqlite"), side("a.sqlite"));
  ASSERT_FALSE(mixed);
  EXPECT_NE(mixed.error().detail.find("--profile-a"), std::string::npos);
  CampaignSide a = side("a.sqlite"), b = a;
  a.profile = "paper";
  b.profile = "default";
  const auto all = compare_campaigns(a, b);
  ASSERT_TRUE(all) << all.error().detail;
  EXPECT_EQ(all->front().landed.only_b, 6);
  EXPECT_EQ(all->front().crashed.only_a, 6);
  EXPECT_NEAR(all->front().landed.p, 2.0 / 64, 1e-12);
}

TEST_F(Stores, WhatCannotBeComparedIsSaid) {
  put("a.sqlite", "circle", 1, Outcome::landed, 0.02);
  put("b.sqlite", "block", 1, Outcome::landed, 0.02);
  const auto apart = compare_campaigns(side("a.sqlite"), side("b.sqlite"));
  ASSERT_FALSE(apart);
  EXPECT_NE(apart.error().detail.find("twin"), std::string::npos);
  const auto gone = compare_campaigns(side("a.sqlite"), side("no.sqlite"));
  ASSERT_FALSE(gone);
  EXPECT_NE(gone.error().detail.find("no.sqlite: no such file"), std::string::npos);
  // Other names may be held against each other when both are named.
  CampaignSide a = side("a.sqlite"), b = side("b.sqlite");
  a.scenario = "circle";
  b.scenario = "block";
  const auto both = compare_campaigns(a, b);
  ASSERT_TRUE(both) << both.error().detail;
  EXPECT_EQ(both->front().scenario, "circle / block");
}

}  // namespace
}  // namespace alight
