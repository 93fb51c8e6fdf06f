#include "alight/io/image_source.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/videoio.hpp>
#include <optional>

#include "alight/io/files.h"
#include "alight/io/held_standard_error.h"
#include "alight/io/text.h"

namespace alight {
namespace fs = std::filesystem;
namespace {

struct Entry {
  Time t = 0;
  std::string file;
  std::string depth_file;
};

std::string lower(std::string text) {
  for (char& c : text)
    c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

bool has_extension(const fs::path& path, std::initializer_list<const char*> known) {
  const std::string ending = lower(path.extension().string());
  return std::any_of(known.begin(), known.end(),
                     [&](const char* one) { return ending == one; });
}
bool is_picture(const fs::path& path) {
  return has_extension(path, {".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff"});
}

/// As people count: frame2 before frame10.
bool before(const std::string& a, const std::string& b) {
  const auto digit = [](char c) { return c >= '0' && c <= '9'; };
  std::size_t i = 0;
  std::size_t j = 0;
  while (i < a.size() && j < b.size()) {
    if (!digit(a[i]) || !digit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i;
      ++j;
      continue;
    }
    std::size_t i_end = i;
    std::size_t j_end = j;
    while (i_end < a.size() && digit(a[i_end])) ++i_end;
    while (j_end < b.size() && digit(b[j_end])) ++j_end;
    while (i + 1 < i_end && a[i] == '0') ++i;
    while (j + 1 < j_end && b[j] == '0') ++j;
    if (i_end - i != j_end - j) return i_end - i < j_end - j;
    const int order = a.compare(i, i_end - i, b, j, j_end - j);
    if (order != 0) return order < 0;
    i = i_end;
    j = j_end;
  }
  if ((i < a.size()) != (j < b.size())) return j < b.size();
  return a < b;
}

Result<std::vector<Entry>> list_folder(const std::string& path, double rate_hz) {
  std::vector<std::string> names;
  std::error_code code;
  for (fs::directory_iterator it(path, code), end; !code && it != end;
       it.increment(code)) {
    if (is_picture(it->path()) && it->is_regular_file(code)) {
      names.push_back(it->path().filename().string());
    }
  }
  if (code) return fail(Fault::io, path + ": " + code.message());
  if (names.empty()) {
    return fail(Fault::io, path + ": holds neither frames.csv nor pictures");
  }
  std::sort(names.begin(), names.end(), before);
  std::vector<Entry> entries;
  for (std::size_t i = 0; i < names.size(); ++i) {
    entries.push_back({from_seconds(static_cast<double>(i) / rate_hz),
                       (fs::path(path) / names[i]).string(),
                       {}});
  }
  return entries;
}

int column_of(const std::vector<std::string_view>& header, std::string_view name) {
  for (std::size_t i = 0; i < header.size(); ++i) {
    if (trimmed(header[i]) == name) return static_cast<int>(i);
  }
  return -1;
}

/// Times so many times farther apart than the camera takes pictures are in another
/// unit.
Result<void> check_unit(const std::string& path, const std::vector<Entry>& entries,
                        double rate_hz) {
  if (entries.size() < 3) return {};
  std::vector<Time> steps;
  for (std::size_t i = 1; i < entries.size(); ++i) {
    steps.push_back(entries[i].t - entries[i - 1].t);
  }
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  const double pictures = to_seconds(*middle) * rate_hz;
  for (const auto& [unit, times] :
       {std::pair{"milliseconds", 1e3}, {"microseconds", 1e6}, {"nanoseconds", 1e9}}) {
    if (pictures < times / 2 || pictures > times * 2) continue;
    return fail(Fault::invalid_input,
                path + ": t grows by " + number_text(to_seconds(*middle)) +
                    " from line to line, and the rig's camera takes " +
                    number_text(rate_hz) + " pictures a second: these look like " +
                    unit + ", t is in seconds");
  }
  return {};
}

Result<std::vector<Entry>> read_list(const std::string& folder, double rate_hz) {
  const std::string path = (fs::path(folder) / "frames.csv").string();
  const auto text = read_file(path);
  if (!text) return fail(text.error());
  int number = 0;
  const auto wrong = [&](const std::string& what) {
    return fail(Fault::invalid_input,
                path + ":" + std::to_string(number) + ": " + what);
  };
  std::vector<Entry> entries;
  int t_column = -1;
  int file_column = -1;
  int depth_column = -1;
  std::size_t columns = 0;
  for (std::string_view line : split(*text, '\n')) {
    ++number;
    line = trimmed(line);
    if (number == 1) {
      line = without_byte_order_mark(line);
      const auto header = split(line, ',');
      columns = header.size();
      t_column = column_of(header, "t");
      file_column = column_of(header, "file");
      depth_column = column_of(header, "depth_file");
      for (const std::string_view name : {"t", "file", "depth_file"}) {
        if (std::count(header.begin(), header.end(), name) > 1) {
          return wrong("the header has " + std::string(name) + " twice");
        }
      }
      if (t_column < 0 || file_column < 0) {
        return wrong(std::string("the header lacks the column ") +
                     (t_column < 0 ? "t" : "file") +
                     ", it should be t,file[,depth_file]");
      }
      continue;
    }
    if (line.empty()) continue;
    const auto fields = split(line, ',');
    if (fields.size() != columns) {
      return wrong("found " + std::to_string(fields.size()) +
                   " fields, the header has " + std::to_string(columns));
    }
    const auto field = [&](int column) {
      return trimmed(fields[static_cast<std::size_t>(column)]);
    };
    Entry entry;
    double t = 0;
    if (!parse_number(field(t_column), t)) {
      return wrong("t must be a finite number, found " + quoted(field(t_column)));
    }
    if (!parse_time(field(t_column), entry.t)) {
      return wrong("t must be in seconds, found " + quoted(field(t_column)));
    }
    if (!entries.empty() && entry.t <= entries.back().t) {
      return wrong("t must grow from line to line, found " +
                   std::string(field(t_column)) + " after " +
                   number_text(to_seconds(entries.back().t)));
    }
    const auto place = [&](int column, std::string& file) -> Result<void> {
      if (column < 0 || field(column).empty()) return {};
      file = (fs::path(folder) / field(column)).string();
      return find_file(file);
    };
    if (field(file_column).empty()) return wrong("the field file is empty");
    if (auto there = place(file_column, entry.file); !there) {
      return wrong(there.error().detail);
    }
    if (auto there = place(depth_column, entry.depth_file); !there) {
      return wrong(there.error().detail);
    }
    entries.push_back(std::move(entry));
  }
  if (entries.empty()) {
    return fail(Fault::invalid_input, path + ": lists no pictures");
  }
  if (auto good = check_unit(path, entries, rate_hz); !good) return fail(good.error());
  return entries;
}

std::string size_text(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

}  // namespace

struct ImageSource::State {
  std::string path;
  int width = 0;
  int height = 0;
  double rate_hz = 60;
  Mosaic mosaic = Mosaic::none;
  std::vector<Entry> entries;
  std::optional<cv::VideoCapture> video;
  int video_count = 0;
  std::size_t next = 0;

  Result<void> check_size(const std::string& name, int w, int h) const {
    if (w == width && h == height) return {};
    return fail(Fault::invalid_input, name + ": is " + size_text(w, h) +
                                          ", the rig's camera gives " +
                                          size_text(width, height));
  }
  Result<bool> next_video(SourceFrame& frame);
  Result<bool> next_file(SourceFrame& frame);
};

ImageSource::ImageSource(std::unique_ptr<State> state) : state_(std::move(state)) {}
ImageSource::ImageSource(ImageSource&&) noexcept = default;
ImageSource& ImageSource::operator=(ImageSource&&) noexcept = default;
ImageSource::~ImageSource() = default;

Result<ImageSource> ImageSource::open(const std::string& path, const Rig& rig) {
  auto state = std::make_unique<State>();
  state->path = path;
  state->width = rig.camera.intrinsics.width;
  state->height = rig.camera.intrinsics.height;
  state->rate_hz = rig.timing.rate_hz;
  state->mosaic = rig.mosaic;
  std::error_code code;
  const fs::file_status status = fs::status(path, code);
  if (fs::is_directory(status)) {
    std::error_code unseen;
    const bool listed = fs::exists(fs::path(path) / "frames.csv", unseen);
    const double rate_hz = rig.timing.rate_hz;
    auto entries = listed ? read_list(path, rate_hz) : list_folder(path, rate_hz);
    if (!entries) return fail(entries.error());
    state->entries = std::move(*entries);
    return ImageSource(std::move(state));
  }
  if (!fs::status_known(status)) return fail(Fault::io, path + ": " + code.message());
  if (!fs::exists(status)) return fail(Fault::io, path + ": no such file or folder");
  if (is_picture(path)) {
    return fail(Fault::io, path + ": is one picture; give the folder that holds it");
  }
  state->video.emplace();
  // A file that is none is told by us, in one line.
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  {
    const HeldStandardError held;
    try {
      state->video->open(path, cv::CAP_FFMPEG);
    } catch (const cv::Exception&) {
      state->video->release();
    }
  }
  if (!state->video->isOpened()) {
    return fail(Fault::invalid_input, path + ": is not a video that can be read");
  }
  const double fps = state->video->get(cv::CAP_PROP_FPS);
  if (fps > 1 && fps < 1000) state->rate_hz = fps;
  // A damaged header may claim any number.
  const double claimed = state->video->get(cv::CAP_PROP_FRAME_COUNT);
  if (claimed > 0 && claimed < 1e9) state->video_count = static_cast<int>(claimed);
  return ImageSource(std::move(state));
}

int ImageSource::count() const {
  return state_->video ? state_->video_count : static_cast<int>(state_->entries.size());
}

Result<bool> ImageSource::next(SourceFrame& frame) {
  return state_->video ? state_->next_video(frame) : state_->next_file(frame);
}

Result<bool> ImageSource::State::next_video(SourceFrame& frame) {
  cv::Mat picture;
  const HeldStandardError held;
  try {
    if (!video->read(picture) || picture.empty()) {
      if (next == 0) return fail(Fault::invalid_input, path + ": holds no pictures");
      return false;
    }
  } catch (const cv::Exception&) {
    return fail(Fault::invalid_input,
                path + ": breaks off after frame " + std::to_string(next));
  }
  frame.name = path + " frame " + std::to_string(next);
  frame.t = from_seconds(static_cast<double>(next) / rate_hz);
  if (auto good = check_size(frame.name, picture.cols, picture.rows); !good) {
    return fail(good.error());
  }
  frame.color = copy_of({picture.data, picture.cols, picture.rows, picture.channels(),
                         static_cast<std::ptrdiff_t>(picture.step[0])},
                        Channels::color);
  frame.depth = {};
  ++next;
  return true;
}

Result<bool> ImageSource::State::next_file(SourceFrame& frame) {
  if (next == entries.size()) return false;
  const Entry& entry = entries[next];
  const bool raw = mosaic != Mosaic::none;
  auto color = load_image(entry.file, raw ? Channels::as_stored : Channels::color);
  if (!color) return fail(color.error());
  if (auto good = check_size(entry.file, color->width, color->height); !good) {
    return fail(good.error());
  }
  if (color->channels == 1 && raw) color = demosaiced(*color, mosaic);
  frame.depth = {};
  if (!entry.depth_file.empty()) {
    auto depth = load_depth(entry.depth_file);
    if (!depth) return fail(depth.error());
    if (auto good = check_size(entry.depth_file, depth->width, depth->height); !good) {
      return fail(good.error());
    }
    frame.depth = std::move(*depth);
  }
  frame.name = entry.file;
  frame.t = entry.t;
  frame.color = std::move(*color);
  ++next;
  return true;
}

}  // namespace alight
