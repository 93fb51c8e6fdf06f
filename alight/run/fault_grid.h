#pragma once
#include <map>
#include <string>
#include <vector>

#include "alight/base/result.h"
#include "alight/run/campaign.h"

namespace alight {

/// One way to go wrong, without its instant, and how a landing may then end.
struct FaultCase {
  std::string name;
  FaultScenario fault;
  std::vector<Outcome> ends;         ///< Any other is wrong,
  std::vector<std::string> because;  ///< as is a reason that holds none of these, of a
                                     ///< landing that did not come about.
};

/// Reads a file of fault cases:
///
///   cases:
///     - {name: pictures stop, kind: camera_out, for_s: 1000,
///        ends: landed aborted, because: no pictures | out of sight}
///
/// with the parameters of each kind (fault.h); `at_s` is the grid's. Without `ends`
/// all but a crash and a timeout will do, without `because` any reason.
Result<std::vector<FaultCase>> load_fault_cases(const std::string& path);
Result<std::vector<FaultCase>> parse_fault_cases(const std::string& text,
                                                 const std::string& name);

/// Which faults meet which scenarios when.
struct FaultGrid {
  std::vector<FaultCase> cases;
  std::vector<double> at_s;  ///< Each case begins at each of these,
  bool pairs = false;        ///< or each two cases once, the instants in turn, the
                             ///< second of the two a little after the first.
};

/// Every scenario with every fault or pair of the grid in place of its own faults,
/// named "SCENARIO + FAULT at 3 s". A pair may end as either of its faults may.
std::vector<CampaignScenario> apply_faults(const std::vector<CampaignScenario>& bases,
                                           const FaultGrid& grid);

/// How the landings with one fault (or pair) ended, over scenarios, instants and seeds.
struct FaultSummary {
  std::string fault;
  int runs = 0;
  int wrong = 0;  ///< Ended as they should not (CampaignScenario::ends).
  std::map<std::string, int> outcomes = {};
  std::map<std::string, int> reasons = {};  ///< "outcome: reason"
  double drift_max_m = 0;  ///< Of lost links, NaN where there was none.
  double sink_max_m_s = 0;
};

/// In the order in which the faults first occur; scenarios without fault are left out.
std::vector<FaultSummary> summarize_faults(const CampaignOptions& options,
                                           const CampaignResult& result);

/// As a table of Markdown, a row a fault.
std::string fault_table(const std::vector<FaultSummary>& summaries);

/// What a drone may do while its autopilot acts alone: drift over the ground and sink.
inline constexpr double kDriftMax_m = 1.5;
inline constexpr double kSinkMax_m_s = 0.7;

/// Whether a landing of this scenario may end so: outcome and reason are those
/// expected, and a drone left alone has neither drifted too far nor sunk too fast. What
/// a drone left alone over the platform meets is not held against it
/// (LostLink::helpless).
bool ended_well(const CampaignScenario& scenario, const LandingResult& result);

}  // namespace alight
