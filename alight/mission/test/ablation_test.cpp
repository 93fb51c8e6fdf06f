#include "alight/mission/ablation.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "alight/geometry/rig.h"

namespace alight {
namespace {

// What each part switches, and nothing else of the six.
std::string switches(const LandingConfig& c) {
  std::string on;
  on += c.mission.replan_every_s > 0 ? 'r' : '-';
  on += c.mission.way_back ? 'e' : '-';
  on += c.attitude.feed_forward ? 'f' : '-';
  on += c.delay_compensation ? 'd' : '-';
  on += c.platform.carry_forward && c.mission.plan_with_turns ? 'p' : '-';
  on += c.estimator.calibrate_at_rest ? 'c' : '-';
  return on;
}

TEST(Ablation, ADroneThatIsToLandFliesWithAllParts) {
  EXPECT_EQ(switches(LandingConfig::standard(alan_rig())), "refdpc");
}

TEST(Ablation, EachPartSwitchesItselfAndNothingElse) {
  const LandingConfig standard = LandingConfig::standard(alan_rig());
  const std::string all = "refdpc";
  LandingConfig bare = standard;
  std::set<std::string> names;
  for (std::size_t i = 0; i < kParts.size(); ++i) {
    const LandingConfig less = without(kParts[i], standard);
    std::string expected = all;
    expected[i] = '-';
    EXPECT_EQ(switches(less), expected) << to_string(kParts[i]);
    EXPECT_TRUE(less.validate());
    names.insert(to_string(kParts[i]));
    bare = without(kParts[i], bare);
  }
  EXPECT_EQ(switches(bare), "------");
  EXPECT_EQ(names.size(), kParts.size());
}

}  // namespace
}  // namespace alight
