#include "alight/run/campaign_store.h"

#include <sqlite3.h>

#include <cstdio>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "alight/io/files.h"
#include "alight/run/run_record.h"

namespace alight {
namespace {

// "Alit" in the file's header says whose it is.
constexpr int kApplicationId = 0x416c6974;
constexpr int kLayout = 1;
constexpr int kWaitMs = 30'000;

constexpr const char* kTable =
    "CREATE TABLE IF NOT EXISTS landing("
    "scenario TEXT NOT NULL, scenario_hash TEXT NOT NULL, rig_hash TEXT NOT NULL, "
    "profile TEXT NOT NULL, seed INTEGER NOT NULL, timeout_s REAL NOT NULL, "
    "depth INTEGER NOT NULL, version TEXT NOT NULL, outcome TEXT NOT NULL, "
    "result TEXT NOT NULL, "
    "PRIMARY KEY(scenario, scenario_hash, rig_hash, profile, seed, timeout_s, depth, "
    "version)) WITHOUT ROWID";

struct Finalize {
  void operator()(sqlite3_stmt* s) const { sqlite3_finalize(s); }
};
using Statement = std::unique_ptr<sqlite3_stmt, Finalize>;

Error trouble(const std::string& file, sqlite3* db) {
  const int code = db != nullptr ? sqlite3_errcode(db) : SQLITE_NOMEM;
  const std::string what = db != nullptr ? sqlite3_errmsg(db) : "out of memory";
  if (code == SQLITE_NOTADB || code == SQLITE_CORRUPT) {
    return {Fault::io, file + ": no store of landings (" + what +
                           "): move it away or name another file"};
  }
  return {Fault::io, file + ": " + what};
}

Result<Statement> prepare(const std::string& file, sqlite3* db, const char* sql) {
  sqlite3_stmt* raw = nullptr;
  if (sqlite3_prepare_v2(db, sql, -1, &raw, nullptr) != SQLITE_OK) {
    return fail(trouble(file, db));
  }
  return Statement(raw);
}

Result<void> execute(const std::string& file, sqlite3* db, const std::string& sql) {
  if (sqlite3_exec(db, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
    return fail(trouble(file, db));
  }
  return {};
}

Result<int> pragma(const std::string& file, sqlite3* db, const char* sql) {
  auto statement = prepare(file, db, sql);
  if (!statement) return fail(statement.error());
  if (sqlite3_step(statement->get()) != SQLITE_ROW) return fail(trouble(file, db));
  return sqlite3_column_int(statement->get(), 0);
}

void bind_to(sqlite3_stmt* s, int at, const std::string& text) {
  sqlite3_bind_text(s, at, text.data(), static_cast<int>(text.size()),
                    SQLITE_TRANSIENT);
}

/// Binds the key to the parameters 1 to 8.
void bind_to(sqlite3_stmt* s, const CampaignKey& key) {
  bind_to(s, 1, key.scenario);
  bind_to(s, 2, key.scenario_hash);
  bind_to(s, 3, key.rig_hash);
  bind_to(s, 4, key.profile);
  sqlite3_bind_int64(s, 5, static_cast<sqlite3_int64>(key.seed));
  sqlite3_bind_double(s, 6, key.timeout_s);
  sqlite3_bind_int(s, 7, key.depth ? 1 : 0);
  bind_to(s, 8, key.version);
}

Error unreadable(const std::string& file, const CampaignKey& key, const Error& why) {
  return {Fault::io, file + ": " + key.scenario + ", seed " + std::to_string(key.seed) +
                         ": " + why.detail + ": move the file away or name another"};
}

/// A store's file is empty, or marked as ours.
Result<void> lay_out(const std::string& file, sqlite3* db) {
  const auto id = pragma(file, db, "PRAGMA application_id");
  if (!id) return fail(id.error());
  const auto layout = pragma(file, db, "PRAGMA user_version");
  if (!layout) return fail(layout.error());
  const auto tables = pragma(file, db, "SELECT count(*) FROM sqlite_master");
  if (!tables) return fail(tables.error());
  const bool fresh = *id == 0 && *layout == 0 && *tables == 0;
  if (!fresh && (*id != kApplicationId || *layout != kLayout)) {
    return fail(Fault::io, file +
                               ": no store of landings (a database of another kind or "
                               "layout): move it away or name another file");
  }
  // A killed program loses nothing; a power cut at most the last rows.
  for (const std::string& sql :
       {std::string("PRAGMA journal_mode = WAL"),
        std::string("PRAGMA synchronous = NORMAL"), std::string(kTable),
        "PRAGMA application_id = " + std::to_string(kApplicationId),
        "PRAGMA user_version = " + std::to_string(kLayout)}) {
    if (auto good = execute(file, db, sql); !good) return good;
  }
  return {};
}

}  // namespace

std::string content_hash(std::string_view text) {
  std::uint64_t hash = 14695981039346656037ull;
  for (const char c : text) {
    hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  }
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016llx",
                static_cast<unsigned long long>(hash));
  return digits;
}

Result<LandingResult> result_from_json(const std::string& text) {
  using Json = nlohmann::json;
  const Json j = Json::parse(text, nullptr, false);
  if (j.is_discarded()) return fail(Fault::invalid_input, "not JSON");
  const auto number = [](const Json& of, const char* name) {
    const Json& value = of.at(name);
    return value.is_null() ? std::numeric_limits<double>::quiet_NaN()
                           : value.get<double>();
  };
  try {
    LandingResult r;
    const std::string outcome = j.at("outcome");
    bool known = false;
    for (int i = 0; i <= static_cast<int>(Outcome::timeout); ++i) {
      if (outcome != to_string(static_cast<Outcome>(i))) continue;
      r.outcome = static_cast<Outcome>(i);
      known = true;
    }
    if (!known) return fail(Fault::invalid_input, "unknown outcome '" + outcome + "'");
    r.reason = j.at("reason");
    r.attempts = j.at("attempts");
    if (const Json& down = j.at("touchdown"); !down.is_null()) {
      r.touchdown = LandingResult::Touchdown{
          number(down, "t_s"), number(down, "error_m"),
          number(down, "relative_speed_m_s"), number(down, "tilt_deg"),
          number(down, "yaw_error_deg")};
    }
    if (j.contains("lost_link") && !j.at("lost_link").is_null()) {
      const Json& lost = j.at("lost_link");
      r.lost_link =
          LandingResult::LostLink{number(lost, "drift_m"), number(lost, "sink_m_s"),
                                  lost.value("helpless", false)};
    }
    r.tracking_rmse_m = number(j, "tracking_rmse_m");
    r.follow_rmse_m = number(j, "follow_rmse_m");
    const Json& estimate = j.at("estimate");
    r.estimate = {number(estimate, "position_rmse_m"),
                  number(estimate, "rotation_rmse_deg"),
                  number(estimate, "velocity_rmse_m_s"),
                  number(estimate, "tracked_fraction"), number(estimate, "nees_mean")};
    r.platform_speed_max_m_s = number(j, "platform_speed_max_m_s");
    r.drone_speed_max_m_s = number(j, "drone_speed_max_m_s");
    r.simulated_s = number(j, "simulated_s");
    r.events_refused = j.at("events_refused");
    r.realtime_factor = number(j, "realtime_factor");
    for (const auto& [stage, us] : j.at("timing_us").items()) {
      r.timing_us[stage] = {number(us, "p50"), number(us, "p99"), number(us, "max")};
    }
    return r;
  } catch (const Json::exception& wrong) {
    return fail(Fault::invalid_input, wrong.what());
  }
}

void CampaignStore::Close::operator()(sqlite3* db) const { sqlite3_close(db); }

Result<CampaignStore> CampaignStore::open(const std::string& file) {
  const auto parent = std::filesystem::path(file).parent_path().string();
  if (!parent.empty()) {
    if (auto good = make_folder(parent); !good) return fail(good.error());
  }
  sqlite3* raw = nullptr;
  const int code = sqlite3_open_v2(
      file.c_str(), &raw,
      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_FULLMUTEX, nullptr);
  std::unique_ptr<sqlite3, Close> db(raw);
  if (code != SQLITE_OK) return fail(trouble(file, raw));
  sqlite3_busy_timeout(raw, kWaitMs);
  if (auto good = lay_out(file, raw); !good) return fail(good.error());
  return CampaignStore(file, std::move(db));
}

Result<std::optional<LandingResult>> CampaignStore::find(const CampaignKey& key) {
  auto statement = prepare(
      file_, db_.get(),
      "SELECT result FROM landing WHERE scenario = ?1 AND scenario_hash = ?2 AND "
      "rig_hash = ?3 AND profile = ?4 AND seed = ?5 AND timeout_s = ?6 AND "
      "depth = ?7 AND version = ?8");
  if (!statement) return fail(statement.error());
  bind_to(statement->get(), key);
  const int code = sqlite3_step(statement->get());
  if (code == SQLITE_DONE) return std::optional<LandingResult>();
  if (code != SQLITE_ROW) return fail(trouble(file_, db_.get()));
  const auto* text =
      reinterpret_cast<const char*>(sqlite3_column_text(statement->get(), 0));
  auto result = result_from_json(text != nullptr ? text : "");
  if (!result) return fail(unreadable(file_, key, result.error()));
  return std::optional<LandingResult>(std::move(*result));
}

Result<std::vector<StoredLanding>> CampaignStore::all() {
  auto statement = prepare(file_, db_.get(),
                           "SELECT scenario, scenario_hash, rig_hash, profile, seed, "
                           "timeout_s, depth, version, result FROM landing");
  if (!statement) return fail(statement.error());
  sqlite3_stmt* row = statement->get();
  const auto text = [&](int column) -> std::string {
    const auto* bytes = reinterpret_cast<const char*>(sqlite3_column_text(row, column));
    return bytes != nullptr ? bytes : "";
  };
  std::vector<StoredLanding> landings;
  for (;;) {
    const int code = sqlite3_step(row);
    if (code == SQLITE_DONE) return landings;
    if (code != SQLITE_ROW) return fail(trouble(file_, db_.get()));
    const CampaignKey key{text(0),
                          text(1),
                          text(2),
                          text(3),
                          static_cast<std::uint64_t>(sqlite3_column_int64(row, 4)),
                          sqlite3_column_double(row, 5),
                          sqlite3_column_int(row, 6) != 0,
                          text(7)};
    auto result = result_from_json(text(8));
    if (!result) return fail(unreadable(file_, key, result.error()));
    landings.push_back({key, std::move(*result)});
  }
}

Result<void> CampaignStore::insert(const CampaignKey& key,
                                   const LandingResult& result) {
  auto statement =
      prepare(file_, db_.get(),
              "INSERT OR REPLACE INTO landing(scenario, scenario_hash, "
              "rig_hash, profile, seed, timeout_s, depth, version, outcome, "
              "result) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)");
  if (!statement) return fail(statement.error());
  bind_to(statement->get(), key);
  bind_to(statement->get(), 9, to_string(result.outcome));
  bind_to(statement->get(), 10, result_json(result));
  if (sqlite3_step(statement->get()) != SQLITE_DONE) {
    return fail(trouble(file_, db_.get()));
  }
  return {};
}

}  // namespace alight
