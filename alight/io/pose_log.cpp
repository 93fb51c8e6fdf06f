#include "alight/io/pose_log.h"

#include <cmath>
#include <cstdio>

#include "alight/io/files.h"
#include "alight/io/text.h"

namespace alight {
namespace {

/// Walks over the lines of a text and knows where it is, for complaints.
class Lines {
 public:
  Lines(const std::string& path, std::string_view text) : path_(path), rest_(text) {}

  bool next(std::string_view& line) {
    if (rest_.empty()) return false;
    const std::size_t end = rest_.find('\n');
    line = trimmed(rest_.substr(0, end));
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end + 1);
    ++number_;
    return true;
  }
  auto wrong(const std::string& what) const {
    return fail(Fault::invalid_input,
                path_ + ":" + std::to_string(number_) + ": " + what);
  }

 private:
  const std::string& path_;
  std::string_view rest_;
  int number_ = 0;
};

/// Fields between blanks.
std::vector<std::string_view> words(std::string_view line) {
  std::vector<std::string_view> result;
  for (line = trimmed(line); !line.empty(); line = trimmed(line)) {
    const std::size_t end = line.find_first_of(" \t");
    result.push_back(line.substr(0, end));
    line.remove_prefix(end == std::string_view::npos ? line.size() : end);
  }
  return result;
}

/// Decimal seconds to ns without going through double, so that times since 1970 keep
/// their last digits.
bool parse_time(std::string_view text, Time& t) {
  const std::size_t point = text.find('.');
  const std::string_view whole = text.substr(0, point);
  const bool plain = text.find_first_not_of("0123456789.") == std::string_view::npos &&
                     !whole.empty() && whole.size() <= 10;
  if (plain) {
    std::string_view part =
        point == std::string_view::npos ? std::string_view() : text.substr(point + 1);
    if (part.find('.') != std::string_view::npos) return false;
    t = 0;
    for (const char c : whole) t = t * 10 + (c - '0');
    for (std::size_t i = 0; i < 9; ++i)
      t = t * 10 + (i < part.size() ? part[i] - '0' : 0);
    if (part.size() > 9 && part[9] >= '5') ++t;
    return true;
  }
  double seconds = 0;
  if (!parse_number(text, seconds) || std::abs(seconds) > 9e9) return false;
  t = from_seconds(seconds);
  return true;
}

bool parse_all(const std::vector<std::string_view>& fields,
               std::vector<double>& numbers, std::size_t& bad) {
  numbers.resize(fields.size());
  for (bad = 0; bad < fields.size(); ++bad) {
    if (!parse_number(trimmed(fields[bad]), numbers[bad])) return false;
  }
  return true;
}

Result<PoseLog> parse_tum(const std::string& path, std::string_view text) {
  PoseLog log;
  Lines lines(path, text);
  std::string_view line;
  std::vector<double> v;
  while (lines.next(line)) {
    line = trimmed(line.substr(0, line.find('#')));
    if (line.empty()) continue;
    const auto fields = words(line);
    if (fields.size() != 8) {
      return lines.wrong("found " + std::to_string(fields.size()) +
                         " fields, a TUM line has 8: t tx ty tz qx qy qz qw");
    }
    std::size_t bad = 0;
    Time t = 0;
    if (!parse_all(fields, v, bad) || !parse_time(fields[0], t)) {
      return lines.wrong(quoted(fields[bad < 8 ? bad : 0]) + " is not a finite number");
    }
    Eigen::Quaterniond q(v[7], v[4], v[5], v[6]);
    if (q.norm() < 1e-3) return lines.wrong("the quaternion is zero");
    if (!log.empty() && t <= log.back().first) {
      return lines.wrong("time does not advance");
    }
    log.emplace_back(t,
                     make_pose(q.normalized().toRotationMatrix(), {v[1], v[2], v[3]}));
  }
  if (log.empty()) return fail(Fault::invalid_input, path + ": holds no poses");
  return log;
}

/// Where the columns stand, by the number of them: LED logs have three more.
struct Layout {
  std::size_t columns;
  std::size_t roll;
};
constexpr Layout kLayouts[] = {{10, 3}, {13, 6}};

Result<RunLog> parse_authors(const std::string& path, std::string_view text) {
  RunLog log;
  log.rows_match = true;
  Lines lines(path, text);
  std::string_view line;
  lines.next(line);
  const Layout* layout = nullptr;
  if (lines.next(line)) {
    if (!line.empty() && line.back() == ',') line.remove_suffix(1);
    for (const Layout& known : kLayouts) {
      if (split(line, ',').size() == known.columns) layout = &known;
    }
  }
  if (!layout || line.substr(0, 6) != "x,y,z,") {
    return lines.wrong(
        "expected the header x,y,z,[st_x,st_y,st_z,]r,p,y,ori,ms,dpth,t");
  }
  std::vector<double> v;
  while (lines.next(line)) {
    if (line.empty()) continue;
    if (line.back() == ',') line.remove_suffix(1);
    const auto fields = split(line, ',');
    if (fields.size() != layout->columns) {
      return lines.wrong("found " + std::to_string(fields.size()) +
                         " fields, the header has " + std::to_string(layout->columns));
    }
    std::size_t bad = 0;
    if (!parse_all(fields, v, bad)) {
      return lines.wrong(quoted(fields[bad]) + " is not a finite number");
    }
    const Time t = from_seconds(v.back());
    if (!log.poses.empty() && t < log.poses.back().first) {
      return lines.wrong("time runs backwards");
    }
    const std::size_t r = layout->roll;
    log.poses.emplace_back(
        t, make_pose(from_rpy(v[r], v[r + 1], v[r + 2]), {v[0], v[1], v[2]}));
    log.frame_ms.push_back(1e3 * v[r + 4]);
  }
  if (log.poses.empty()) return fail(Fault::invalid_input, path + ": holds no poses");
  return log;
}

constexpr std::string_view kDriveHeader = "t,x,y,z,yaw_deg";

Result<PoseLog> parse_drive_table(const std::string& name, std::string_view text) {
  PoseLog log;
  Lines lines(name, text);
  std::string_view line;
  lines.next(line);
  if (line != kDriveHeader) {
    return lines.wrong("expected the header " + std::string(kDriveHeader) + ", found " +
                       quoted(line.substr(0, 60)));
  }
  std::vector<double> v;
  while (lines.next(line)) {
    if (line.empty()) continue;
    const auto fields = split(line, ',');
    if (fields.size() != 5) {
      return lines.wrong("found " + std::to_string(fields.size()) +
                         " fields, the header has 5");
    }
    std::size_t bad = 0;
    Time t = 0;
    if (!parse_all(fields, v, bad) || !parse_time(trimmed(fields[0]), t)) {
      return lines.wrong(quoted(fields[bad < 5 ? bad : 0]) + " is not a finite number");
    }
    if (!log.empty() && t <= log.back().first) {
      return lines.wrong("time does not advance");
    }
    log.emplace_back(t, make_pose(from_rpy(0, 0, v[4] * kDegree), {v[1], v[2], v[3]}));
  }
  if (log.empty()) return fail(Fault::invalid_input, name + ": holds no poses");
  return log;
}

bool looks_like_csv(std::string_view text) {
  const std::size_t first = text.find('\n');
  if (first == std::string_view::npos) return false;
  return text.substr(first + 1, 2) == "x,";
}

}  // namespace

Result<PoseLog> load_tum(const std::string& path) {
  const auto text = read_file(path);
  if (!text) return fail(text.error());
  return parse_tum(path, *text);
}

std::string tum_text(const PoseLog& log) {
  std::string text = "# t tx ty tz qx qy qz qw\n";
  for (const auto& [t, X] : log) {
    char time[40];
    const Time ns = t < 0 ? -t : t;
    std::snprintf(time, sizeof time, "%s%lld.%09lld", t < 0 ? "-" : "",
                  static_cast<long long>(ns / 1000000000),
                  static_cast<long long>(ns % 1000000000));
    text += time;
    const Vector3 p = X.translation();
    Eigen::Quaterniond q(X.linear());
    if (q.w() < 0) q.coeffs() *= -1;
    for (const double v : {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()}) {
      char number[40];
      std::snprintf(number, sizeof number, " %.9f", v);
      text += number;
    }
    text += '\n';
  }
  return text;
}

Result<void> save_tum(const std::string& path, const PoseLog& log) {
  return write_file(path, tum_text(log));
}

Result<RunLog> load_authors_csv(const std::string& path) {
  const auto text = read_file(path);
  if (!text) return fail(text.error());
  return parse_authors(path, *text);
}

Result<PoseLog> parse_drive(const std::string& name, std::string_view text) {
  const std::string_view first = trimmed(text.substr(0, text.find('\n')));
  // A TUM line has no comma, and its comment a mark.
  const bool table = first.find(',') != std::string_view::npos && first[0] != '#';
  return table ? parse_drive_table(name, text) : parse_tum(name, text);
}

Result<RunLog> load_pose_log(const std::string& path) {
  const auto text = read_file(path);
  if (!text) return fail(text.error());
  if (looks_like_csv(*text)) return parse_authors(path, *text);
  auto log = parse_tum(path, *text);
  if (!log) return fail(log.error());
  return RunLog{std::move(*log), {}, false};
}

}  // namespace alight
