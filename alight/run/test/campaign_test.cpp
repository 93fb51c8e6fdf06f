#include "alight/run/campaign.h"

#include <cmath>
#include <fstream>

#include "alight/io/files.h"
#include "alight/run/campaign_store.h"
#include "alight/run/campaign_summary.h"
#include "run_scenarios.h"

namespace alight {
namespace {

/// Two scenarios, quick ones: the first seconds of a flight are enough here.
CampaignOptions quick() {
  CampaignOptions options;
  for (const char* name : {"still", "circle"}) {
    options.scenarios.push_back({name, test::options_of(name, 1).scenario});
  }
  options.rig = alan_rig();
  options.seeds = 3;
  options.timeout_s = 2;
  options.depth = false;  // for speed
  options.version = "test";
  return options;
}

CampaignResult run(const CampaignOptions& options) {
  const auto result = run_campaign(options);
  EXPECT_TRUE(result) << result.error().detail;
  return result ? *result : CampaignResult{};
}

/// Every figure of every landing, in order, but for timing.
std::string all_figures(const CampaignResult& result) {
  std::string text;
  for (const CampaignRun& run : result.runs) {
    text += std::to_string(run.scenario) + " " + std::to_string(run.seed) + " " +
            test::figures(run.result) + "\n";
  }
  return text;
}

std::string table(const CampaignOptions& options, const CampaignResult& result) {
  std::string text;
  for (const auto& summary : summarize(options, result)) text += summary_text(summary);
  return text;
}

TEST(Campaign, NumberOfThreadsDoesNotMatter) {
  CampaignOptions options = quick();
  options.jobs = 1;
  const std::string one = all_figures(run(options));
  options.jobs = 4;
  EXPECT_EQ(one, all_figures(run(options)));
}

TEST(Campaign, SameAsSingleLandings) {
  CampaignOptions options = quick();
  options.first_seed = 5;
  const CampaignResult result = run(options);
  ASSERT_EQ(result.runs.size(), 6u);
  const CampaignRun& last = result.runs.back();
  EXPECT_EQ(last.scenario, 1u);
  EXPECT_EQ(last.seed, 7u);
  LandingRunOptions one = test::options_of("circle", 7);
  one.timeout_s = options.timeout_s;
  one.depth = options.depth;
  const auto alone = run_landing(one);
  ASSERT_TRUE(alone);
  EXPECT_EQ(test::figures(last.result), test::figures(*alone));
}

TEST(Campaign, GoesOnWhereItWasAndTellsTheSame) {
  const test::Folder folder;
  CampaignOptions options = quick();
  options.store = folder.file("deep/store.sqlite");
  options.seeds = 1;
  EXPECT_EQ(run(options).from_store, 0);
  options.seeds = 3;
  const CampaignResult rest = run(options);
  EXPECT_EQ(rest.from_store, 2);
  const CampaignResult stored = run(options);
  EXPECT_EQ(stored.from_store, 6);
  // The stored ones to the last bit, timing included.
  EXPECT_EQ(table(options, rest), table(options, stored));
  CampaignOptions fresh = options;
  fresh.store.clear();
  EXPECT_EQ(all_figures(run(fresh)), all_figures(stored));
}

TEST(Campaign, TakesOverNothingThatWasComputedOtherwise) {
  const test::Folder folder;
  CampaignOptions options = quick();
  options.scenarios.resize(1);
  options.seeds = 1;
  options.timeout_s = 1;
  options.store = folder.file("store.sqlite");
  run(options);
  ASSERT_EQ(run(options).from_store, 1);
  const auto changed = [&](auto&& change) {
    CampaignOptions other = options;
    change(other);
    return run(other).from_store;
  };
  EXPECT_EQ(changed([](auto& o) { o.scenarios[0].scenario.wind.mean_m_s = 0.5; }), 0);
  EXPECT_EQ(changed([](auto& o) { o.scenarios[0].name = "other"; }), 0);
  EXPECT_EQ(changed([](auto& o) { o.rig.drone.mass_kg *= 1.01; }), 0);
  EXPECT_EQ(changed([](auto& o) { o.profile = Profile::paper; }), 0);
  EXPECT_EQ(changed([](auto& o) { o.timeout_s = 1.5; }), 0);
  EXPECT_EQ(changed([](auto& o) { o.depth = true; }), 0);
  EXPECT_EQ(changed([](auto& o) { o.version = "another"; }), 0);
  EXPECT_EQ(changed([](auto&) {}), 1);
}

TEST(Campaign, ProgressCountsUpToAll) {
  const CampaignOptions options = quick();
  int calls = 0;
  CampaignProgress last;
  const auto result = run_campaign(options, [&](const CampaignProgress& p) {
    EXPECT_GE(p.done, last.done);
    last = p;
    ++calls;
  });
  ASSERT_TRUE(result);
  EXPECT_EQ(last.done, 6);
  EXPECT_EQ(last.total, 6);
  EXPECT_EQ(calls, 7);
}

TEST(Campaign, BrokenStoreIsToldAndLeftAlone) {
  const test::Folder folder;
  CampaignOptions options = quick();
  options.store = folder.file("broken.sqlite");
  const std::string rubbish(5000, 'x');
  ASSERT_TRUE(write_file(options.store, rubbish));
  const auto result = run_campaign(options);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().fault, Fault::io);
  EXPECT_NE(result.error().detail.find(options.store), std::string::npos);
  EXPECT_NE(result.error().detail.find("no store of landings"), std::string::npos);
  EXPECT_EQ(read_file(options.store).value(), rubbish);
}

TEST(Campaign, TornStoreIsTold) {
  const test::Folder folder;
  CampaignOptions options = quick();
  options.timeout_s = 1;
  options.store = folder.file("torn.sqlite");
  run(options);
  // The second page onwards is lost.
  const std::string whole = read_file(options.store).value();
  ASSERT_GT(whole.size(), 4096u);
  ASSERT_TRUE(write_file(options.store, whole.substr(0, 4096)));
  const auto result = run_campaign(options);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().fault, Fault::io);
  EXPECT_NE(result.error().detail.find(options.store), std::string::npos);
}

TEST(Campaign, StoreInAFolderThatCannotBeIsTold) {
  const test::Folder folder;
  CampaignOptions options = quick();
  ASSERT_TRUE(write_file(folder.file("file"), "no folder"));
  options.store = folder.file("file/store.sqlite");
  const auto result = run_campaign(options);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().fault, Fault::io);
}

TEST(Campaign, OptionsOutOfRangeAreNamed) {
  const auto told = [](auto&& change) {
    CampaignOptions options = quick();
    change(options);
    const auto good = options.validate();
    EXPECT_FALSE(run_campaign(options));
    return good ? std::string() : good.error().detail;
  };
  EXPECT_TRUE(quick().validate());
  EXPECT_TRUE(told([](auto& o) { o.seeds = 0; }).starts_with("seeds: is 0"));
  EXPECT_TRUE(told([](auto& o) { o.jobs = -1; }).starts_with("jobs: is -1"));
  EXPECT_TRUE(told([](auto& o) { o.timeout_s = NAN; }).starts_with("timeout_s"));
  EXPECT_TRUE(told([](auto& o) { o.scenarios.clear(); }).starts_with("scenarios"));
  EXPECT_TRUE(told([](auto& o) {
                o.scenarios[1].scenario.radio.loss = 2;
              }).starts_with("circle: "));
}

TEST(CampaignStore, JsonBringsEveryBitBack) {
  LandingResult r;
  r.outcome = Outcome::lost_link_landing;
  r.reason = "a \"reason\"";
  r.attempts = 3;
  r.touchdown = LandingResult::Touchdown{1.0 / 3, 0.1, 1e-300, -2.5, NAN};
  r.lost_link = LandingResult::LostLink{0.1, 1.0 / 7, true};
  r.tracking_rmse_m = 0.1 + 0.2;
  r.follow_rmse_m = NAN;
  r.estimate = {1e-17, 2.0 / 7, 3, 0.998, 9};
  r.events_refused = 7;
  r.timing_us["step"] = {1.5, 2.5, 1e6 / 3};
  const std::string text = result_json(r);
  const auto back = result_from_json(text);
  ASSERT_TRUE(back) << back.error().detail;
  EXPECT_EQ(result_json(*back), text);
  EXPECT_TRUE(std::isnan(back->follow_rmse_m));
  EXPECT_EQ(back->touchdown->t_s, 1.0 / 3);

  for (const char* bad : {"", "{", "[]", "{}", "{\"outcome\": \"flown\"}"}) {
    EXPECT_FALSE(result_from_json(bad)) << bad;
  }
}

TEST(CampaignSummary, CountsWhatItIsGiven) {
  CampaignOptions options = quick();
  CampaignResult result;
  const Outcome outcomes[] = {Outcome::landed, Outcome::crashed, Outcome::landed,
                              Outcome::timeout};
  for (int i = 0; i < 4; ++i) {
    CampaignRun run;
    run.scenario = 0;
    run.result.outcome = outcomes[i];
    run.result.attempts = i;
    if (i < 3) {
      run.result.touchdown = LandingResult::Touchdown{1, 0.01 * i, 0.16 * i, 2, 0};
    }
    result.runs.push_back(run);
  }
  const auto summaries = summarize(options, result);
  ASSERT_EQ(summaries.size(), 2u);
  EXPECT_EQ(summaries[0].runs, 4);
  EXPECT_EQ(summaries[0].landed, 2);
  EXPECT_EQ(summaries[0].crashed, 1);
  EXPECT_EQ(summaries[0].soft, 1) << "the other one touched at 0.32 m/s";
  EXPECT_EQ(summaries[0].outcomes.at("timeout"), 1);
  EXPECT_DOUBLE_EQ(summaries[0].attempts_mean, 1.5);
  EXPECT_DOUBLE_EQ(summaries[0].touchdown_error_m.p50, 0.01);
  EXPECT_DOUBLE_EQ(summaries[0].touchdown_error_m.max, 0.02);
  EXPECT_LT(summaries[0].landed_interval.low, 0.5);
  EXPECT_GT(summaries[0].landed_interval.high, 0.5);
  EXPECT_EQ(summaries[1].runs, 0);
  EXPECT_TRUE(std::isnan(summaries[1].touchdown_error_m.p50));
}

}  // namespace
}  // namespace alight
