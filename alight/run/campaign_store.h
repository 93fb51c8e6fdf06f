#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alight/base/result.h"
#include "alight/run/landing_run.h"

struct sqlite3;

namespace alight {

/// What a result depends on.
struct CampaignKey {
  std::string scenario;  ///< The name: for people, and a part of the key.
  std::string scenario_hash, rig_hash;
  std::string profile;
  std::uint64_t seed = 0;
  double timeout_s = 0;
  bool depth = true;
  std::string version;
};

struct StoredLanding {
  CampaignKey key;
  LandingResult result;
};

/// 16 hexadecimal digits that stand for a text (FNV-1a; no protection against malice).
std::string content_hash(std::string_view text);

/// result_json read back, every bit of every number; null is NaN. invalid_input.
Result<LandingResult> result_from_json(const std::string& text);

/// Results of landings in one SQLite file, table `landing`: the key's columns,
/// `outcome` and `result`, the text of result.json. A row is on the disk's way before
/// insert returns; killing the program loses nothing that was inserted. Several
/// programs may write at a time; one object belongs to one thread at a time.
class CampaignStore {
 public:
  /// Opens the file, or makes it and the folders above it. io with FILE, what is wrong
  /// and the remedy when it is no such store.
  static Result<CampaignStore> open(const std::string& file);

  Result<std::optional<LandingResult>> find(const CampaignKey& key);
  /// Every landing, by scenario, then as it comes.
  Result<std::vector<StoredLanding>> all();
  Result<void> insert(const CampaignKey& key, const LandingResult& result);

 private:
  struct Close {
    void operator()(sqlite3* db) const;
  };
  CampaignStore(std::string file, std::unique_ptr<sqlite3, Close> db)
      : file_(std::move(file)), db_(std::move(db)) {}
  std::string file_;
  std::unique_ptr<sqlite3, Close> db_;
};

}  // namespace alight
