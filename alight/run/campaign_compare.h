#pragma once
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/eval/statistics.h"

namespace alight {

/// Landings of a store (campaign_store.h); empty: of any profile, version, scenario.
struct CampaignSide {
  std::string store = {};
  std::string profile = {};
  std::string version = {};   ///< Begins so.
  std::string scenario = {};  ///< Given for one side alone it holds for both.
};

/// How two configurations fared on the same seeds: a yes or no.
struct PairedShare {
  int both = 0, only_a = 0, only_b = 0, neither = 0;
  int pairs() const { return both + only_a + only_b + neither; }

  double p =
      1;  ///< McNemar's exact test: that chance alone makes so great a difference.
  double difference = 0;     ///< Share of B less that of A,
  Interval interval{-1, 1};  ///< 95 % (Agresti and Min 2005).
};
/// Fills in what follows from the four counts.
PairedShare paired_share(int both, int only_a, int only_b, int neither);

/// The median of paired differences with its 95 % interval from the order statistics,
/// which holds whatever the distribution. Too few pairs (below 6): no interval, NaN.
struct PairedMedian {
  double median = 0;
  Interval interval;
};
PairedMedian paired_median(std::vector<double> differences);

struct PairedFigure {
  std::string name;
  int pairs = 0;  ///< Landings in which both have the figure.
  double median_a = 0, median_b = 0;
  double difference = 0;  ///< Median of B less A,
  Interval interval;      ///< 95 %.
};

struct CampaignComparison {
  std::string scenario;
  PairedShare landed, first_try, crashed;
  int alone_a = 0, alone_b = 0;  ///< Landings without their twin.
  std::vector<PairedFigure> figures;
};

/// Pairs landings by scenario and seed. invalid_input when one side holds several
/// configurations, or when nothing pairs; io for the stores.
Result<std::vector<CampaignComparison>> compare_campaigns(CampaignSide a,
                                                          CampaignSide b);

/// For people, a block a scenario.
std::string comparison_text(const std::vector<CampaignComparison>& comparisons);

}  // namespace alight
