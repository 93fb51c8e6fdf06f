#include "alight/io/pose_log.h"

#include <cstdio>

#include "alight/io/files.h"
#include "alight/io/text.h"

namespace alight {
namespace {

/// Walks over the lines of a text and knows where it is, for complaints.
class Lines {
 public:
  Lines(const std::string& path, std::string_view text)
      : path_(path), rest_(without_byte_order_mark(text)) {}

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

/// The fields as numbers; field `time` in ns, too.
Result<void> parse_fields(const Lines& lines,
                          const std::vector<std::string_view>& fields, std::size_t time,
                          std::vector<double>& numbers, Time& t) {
  numbers.resize(fields.size());
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (!parse_number(trimmed(fields[i]), numbers[i])) {
      return lines.wrong(quoted(trimmed(fields[i])) + " is not a finite number");
    }
  }
  if (parse_time(trimmed(fields[time]), t)) return {};
  return lines.wrong(quoted(trimmed(fields[time])) + " is not a time in seconds");
}

/// Larger numbers overflow where positions are squared.
constexpr double kFarthest_m = 1e9;

Result<void> put(const Lines& lines, Time t, const Matrix3& R, const Vector3& p,
                 PoseLog& log) {
  if (p.cwiseAbs().maxCoeff() > kFarthest_m) {
    return lines.wrong("the position is more than 1e9 m away");
  }
  log.emplace_back(t, make_pose(R, p));
  return {};
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
    Time t = 0;
    if (auto good = parse_fields(lines, fields, 0, v, t); !good) {
      return fail(good.error());
    }
    const Eigen::Quaterniond q(v[7], v[4], v[5], v[6]);
    if (q.norm() < 1e-3) return lines.wrong("the quaternion is zero");
    if (q.norm() > 1e3) return lines.wrong("the quaternion is far from one of norm 1");
    if (!log.empty() && t <= log.back().first) {
      return lines.wrong("time does not advance");
    }
    const Matrix3 R = q.normalized().toRotationMatrix();
    if (auto good = put(lines, t, R, {v[1], v[2], v[3]}, log); !good) {
      return fail(good.error());
    }
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
    Time t = 0;
    if (auto good = parse_fields(lines, fields, fields.size() - 1, v, t); !good) {
      return fail(good.error());
    }
    if (!log.poses.empty() && t < log.poses.back().first) {
      return lines.wrong("time runs backwards");
    }
    const std::size_t r = layout->roll;
    const Matrix3 R = from_rpy(v[r], v[r + 1], v[r + 2]);
    if (auto good = put(lines, t, R, {v[0], v[1], v[2]}, log.poses); !good) {
      return fail(good.error());
    }
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
    Time t = 0;
    if (auto good = parse_fields(lines, fields, 0, v, t); !good) {
      return fail(good.error());
    }
    if (!log.empty() && t <= log.back().first) {
      return lines.wrong("time does not advance");
    }
    const Matrix3 R = from_rpy(0, 0, v[4] * kDegree);
    if (auto good = put(lines, t, R, {v[1], v[2], v[3]}, log); !good) {
      return fail(good.error());
    }
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
