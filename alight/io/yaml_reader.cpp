#include "alight/io/yaml_reader.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "alight/io/files.h"
#include "alight/io/text.h"

namespace alight {
namespace {

struct Complaint {
  int line = 0;
  std::string text;
};

int line_of(const YAML::Node& node) {
  const YAML::Mark mark = node.Mark();
  return mark.is_null() ? 0 : mark.line + 1;
}

std::string shown(const YAML::Node& node) {
  if (node.IsNull()) return "nothing";
  if (node.IsMap()) return "a map";
  if (node.IsSequence()) return "a list";
  return quoted(node.Scalar());
}

bool to_number(const YAML::Node& node, double& value) {
  return node.IsScalar() && parse_number(node.Scalar(), value);
}

}  // namespace

struct YamlMap::Document {
  std::string name;
  std::vector<Complaint> complaints;
  std::vector<std::shared_ptr<Node>> maps;  ///< All that were asked for.
};

struct YamlMap::Node {
  std::optional<YAML::Node> yaml;  ///< A map; empty when the file has none.
  std::string path;                ///< "camera", "leds[2]"; empty for the file itself
  int line = 1;
  std::vector<std::string> known;  ///< Every key somebody asked for.

  std::string full(const std::string& key) const {
    if (key.empty()) return path;
    return path.empty() ? key : path + "." + key;
  }
  std::optional<YAML::Node> at(const std::string& key) const {
    if (!yaml) return {};
    for (const auto& entry : *yaml) {
      if (entry.first.IsScalar() && entry.first.Scalar() == key) return entry.second;
    }
    return {};
  }
  /// Where the key stands; of an empty value the parser only knows where it looked.
  int line_of_key(const std::string& key) const {
    if (yaml && !key.empty()) {
      for (const auto& entry : *yaml) {
        if (entry.first.IsScalar() && entry.first.Scalar() == key) {
          return line_of(entry.first);
        }
      }
    }
    return line;
  }
  std::optional<YAML::Node> take(const std::string& key) {
    if (std::find(known.begin(), known.end(), key) == known.end()) known.push_back(key);
    return at(key);
  }
};

Result<YamlMap> YamlMap::load(const std::string& path) {
  const auto text = read_file(path);
  if (!text) return fail(text.error());
  return parse(*text, path);
}

Result<YamlMap> YamlMap::parse(const std::string& text, const std::string& name) {
  auto node = std::make_shared<Node>();
  try {
    const std::vector<YAML::Node> all = YAML::LoadAll(text);
    if (all.size() > 1) {
      return fail(Fault::invalid_config,
                  name + ":" + std::to_string(line_of(all[1])) +
                      ": begins a second document, one is needed");
    }
    const YAML::Node root = all.empty() ? YAML::Node() : all.front();
    if (root.IsMap()) {
      node->yaml.emplace(root);
    } else if (!root.IsNull()) {
      return fail(Fault::invalid_config, name + ":1: is not a map of keys and values");
    }
  } catch (const YAML::Exception& wrong) {
    return fail(Fault::invalid_config, name + ":" +
                                           std::to_string(wrong.mark.line + 1) +
                                           ": is not YAML: " + wrong.msg);
  }
  auto document = std::make_shared<Document>();
  document->name = name;
  document->maps.push_back(node);
  return YamlMap(document, node);
}

bool YamlMap::has(const std::string& key) const { return node_->at(key).has_value(); }

void YamlMap::complain(const std::string& key, const std::string& what) {
  const int line = node_->line_of_key(key);
  const std::string full = node_->full(key);
  document_->complaints.push_back({line, (full.empty() ? "" : full + ": ") + what});
}

void YamlMap::require(const std::string& key) {
  if (!node_->take(key)) complain(key, "is missing");
}

void YamlMap::read(const std::string& key, double& value) {
  const auto found = node_->take(key);
  if (found && !to_number(*found, value)) {
    complain(key, "must be a finite number, found " + shown(*found));
  }
}

void YamlMap::read(const std::string& key, int& value) {
  const auto found = node_->take(key);
  if (!found) return;
  double number = 0;
  if (!to_number(*found, number) || number != std::round(number) ||
      std::abs(number) > 2e9) {
    return complain(key, "must be a whole number, found " + shown(*found));
  }
  value = static_cast<int>(number);
}

void YamlMap::read(const std::string& key, bool& value) {
  const auto found = node_->take(key);
  if (!found) return;
  const std::string word = found->IsScalar() ? found->Scalar() : std::string();
  if (word != "true" && word != "false") {
    return complain(key, "must be true or false, found " + shown(*found));
  }
  value = word == "true";
}

void YamlMap::read(const std::string& key, std::string& value) {
  const auto found = node_->take(key);
  if (!found) return;
  if (!found->IsScalar())
    return complain(key, "must be a word, found " + shown(*found));
  value = found->Scalar();
}

void YamlMap::read(const std::string& key, std::vector<double>& value) {
  const auto found = node_->take(key);
  if (!found) return;
  if (!found->IsSequence()) {
    return complain(key, "must be a list of numbers, found " + shown(*found));
  }
  std::vector<double> numbers;
  for (const auto& item : *found) {
    double number = 0;
    if (!to_number(item, number)) {
      return complain(key, "must hold finite numbers, found " + shown(item));
    }
    numbers.push_back(number);
  }
  value = std::move(numbers);
}

void YamlMap::read(const std::string& key, Vector3& value) {
  std::vector<double> numbers(value.data(), value.data() + 3);
  read(key, numbers);
  if (numbers.size() != 3) {
    return complain(
        key, "must be a list of 3 numbers, found " + std::to_string(numbers.size()));
  }
  value = Vector3(numbers[0], numbers[1], numbers[2]);
}

void YamlMap::read(const std::string& key, std::array<double, 5>& value) {
  std::vector<double> numbers(value.begin(), value.end());
  read(key, numbers);
  if (numbers.size() != 5) {
    return complain(
        key, "must be a list of 5 numbers, found " + std::to_string(numbers.size()));
  }
  std::copy(numbers.begin(), numbers.end(), value.begin());
}

int YamlMap::choice(const std::string& key, const std::vector<std::string>& words) {
  const auto found = node_->take(key);
  if (!found) return -1;
  const std::string word = found->IsScalar() ? found->Scalar() : std::string();
  const auto at = std::find(words.begin(), words.end(), word);
  if (at != words.end()) return static_cast<int>(at - words.begin());
  std::string all;
  for (const std::string& known : words) all += (all.empty() ? "" : ", ") + known;
  const std::string near = nearest_key(word, words);
  complain(key, "must be one of " + all + "; found " + shown(*found) +
                    (near.empty() ? "" : ", did you mean " + near + "?"));
  return -1;
}

YamlMap YamlMap::map(const std::string& key) {
  auto child = std::make_shared<Node>();
  child->path = node_->full(key);
  child->line = node_->line;
  if (const auto found = node_->take(key)) {
    child->line = line_of(*found);
    if (found->IsMap()) {
      child->yaml.emplace(*found);
    } else {
      complain(key, "must be a map of keys and values, found " + shown(*found));
    }
  }
  document_->maps.push_back(child);
  return YamlMap(document_, child);
}

std::vector<YamlMap> YamlMap::list(const std::string& key) {
  std::vector<YamlMap> maps;
  const auto found = node_->take(key);
  if (!found) return maps;
  if (!found->IsSequence()) {
    complain(key, "must be a list, found " + shown(*found));
    return maps;
  }
  for (const auto& item : *found) {
    auto child = std::make_shared<Node>();
    child->path = node_->full(key) + "[" + std::to_string(maps.size()) + "]";
    child->line = line_of(item);
    YamlMap map(document_, child);
    if (item.IsMap()) {
      child->yaml.emplace(item);
    } else {
      map.complain({}, "must be a map of keys and values, found " + shown(item));
    }
    document_->maps.push_back(child);
    maps.push_back(std::move(map));
  }
  return maps;
}

Result<void> YamlMap::finish() const {
  std::vector<Complaint> all = document_->complaints;
  for (const auto& map : document_->maps) {
    if (!map->yaml) continue;
    std::vector<std::string> seen;
    for (const auto& entry : *map->yaml) {
      const int line = line_of(entry.first);
      if (!entry.first.IsScalar()) {
        all.push_back({line, "a key must be a word"});
        continue;
      }
      const std::string key = entry.first.Scalar();
      if (std::find(seen.begin(), seen.end(), key) != seen.end()) {
        all.push_back({line, map->full(key) + ": is there twice"});
      }
      seen.push_back(key);
      if (std::find(map->known.begin(), map->known.end(), key) != map->known.end()) {
        continue;
      }
      const std::string near = nearest_key(key, map->known);
      all.push_back({line, map->full(key) + ": unknown key" +
                               (near.empty() ? "" : ", did you mean " + near + "?")});
    }
  }
  if (all.empty()) return {};
  std::stable_sort(all.begin(), all.end(), [](const Complaint& a, const Complaint& b) {
    return a.line < b.line;
  });
  std::string text = document_->name + ":" + std::to_string(all.front().line) + ": " +
                     all.front().text;
  if (all.size() > 1) text += " (and " + std::to_string(all.size() - 1) + " more)";
  return fail(Fault::invalid_config, text);
}

std::string YamlMap::place(const std::string& key) const {
  return document_->name + ":" + std::to_string(node_->line_of_key(key));
}

}  // namespace alight
