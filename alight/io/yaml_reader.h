#pragma once
#include <array>
#include <initializer_list>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "alight/base/result.h"
#include "alight/geometry/so3.h"

namespace alight {

/// One map of a YAML file, read strictly: whatever the file says must be understood.
///
///   auto file = YamlMap::load(path);
///   if (!file) return fail(file.error());
///   YamlMap wind = file->map("wind");
///   wind.read("mean_m_s", scenario.wind.mean_m_s);   // absent: keeps the default
///   if (auto good = file->finish(); !good) return fail(good.error());
///
/// Complaints are collected; `finish` reports the first in the order of the file as
/// "FILE:LINE: KEY: what is wrong", and how many more there are. Every key that no call
/// asked for is one of them, and the nearest known key is named. Keys read twice by two
/// calls are fine; a key written twice in the file is not.
class YamlMap {
 public:
  /// io: missing or unreadable file; invalid_config: not YAML, or not a map.
  static Result<YamlMap> load(const std::string& path);
  /// `name` stands for the file in complaints.
  static Result<YamlMap> parse(const std::string& text, const std::string& name);

  bool has(const std::string& key) const;

  /// The value of `key`, if the file has it. Numbers must be finite, whole for int,
  /// lists of exactly the length of the target.
  void read(const std::string& key, double& value);
  void read(const std::string& key, int& value);
  void read(const std::string& key, bool& value);
  void read(const std::string& key, std::string& value);
  void read(const std::string& key, Vector3& value);
  void read(const std::string& key, std::array<double, 5>& value);
  void read(const std::string& key, std::vector<double>& value);

  /// One word out of several.
  template <class Enum>
  void read_choice(const std::string& key, Enum& value,
                   std::initializer_list<std::pair<const char*, Enum>> choices) {
    std::vector<std::string> words;
    for (const auto& choice : choices) words.emplace_back(choice.first);
    const int i = choice(key, words);
    if (i >= 0) value = choices.begin()[i].second;
  }

  /// The map under `key`; an empty one when the file has none.
  YamlMap map(const std::string& key);
  /// The maps in the list under `key`; none when the file has none.
  std::vector<YamlMap> list(const std::string& key);

  /// Complains unless the file has `key`.
  void require(const std::string& key);
  /// A complaint of the caller's, placed at `key` (or at the map when empty).
  void complain(const std::string& key, const std::string& what);

  /// First complaint about the whole file, unknown keys included.
  Result<void> finish() const;

  /// "FILE:LINE" of `key`, or of this map.
  std::string place(const std::string& key = {}) const;

 private:
  struct Document;
  struct Node;
  YamlMap(std::shared_ptr<Document> document, std::shared_ptr<Node> node)
      : document_(std::move(document)), node_(std::move(node)) {}
  int choice(const std::string& key, const std::vector<std::string>& words);

  std::shared_ptr<Document> document_;
  std::shared_ptr<Node> node_;
};

}  // namespace alight
