#include "alight/run/frame_recorder.h"

#include <cstdio>

#include "alight/io/files.h"
#include "alight/io/image_io.h"
#include "alight/io/pose_log.h"
#include "alight/io/rig_yaml.h"
#include "alight/run/scenario_yaml.h"
#include "alight/run/source_folder.h"

namespace alight {
namespace {

/// To the nanosecond, so that the time reads back as it was. @pre t >= 0
std::string seconds_text(Time t) {
  constexpr Time kSecond = 1'000'000'000;
  char text[40];
  std::snprintf(text, sizeof(text), "%lld.%09lld", static_cast<long long>(t / kSecond),
                static_cast<long long>(t % kSecond));
  return text;
}

}  // namespace

FrameRecorder::FrameRecorder(std::string folder, const LandingRunOptions& options)
    : folder_(std::move(folder)), options_(options), rig_true_(options.rig) {}

void FrameRecorder::on_world(const World& world) { rig_true_ = world.true_rig().rig; }

void FrameRecorder::on_picture(const CameraFrame& frame) {
  // A picture that came late or twice belongs to no sequence in order of time.
  if (!good_ || frame.captured <= last_ || frame.captured < 0) return;
  if (pictures_ == 0) {
    good_ = begin_source(folder_);
    if (!good_) return;
    depth_ = !frame.depth.empty();
    if (depth_) list_ = "t,file,depth_file\n";
  }
  last_ = frame.captured;
  char number[16];
  std::snprintf(number, sizeof(number), "%06d", pictures_++);
  const std::string color = std::string("color_") + number + ".png";
  list_ += seconds_text(frame.captured) + "," + color;
  good_ = save_png(folder_ + "/" + color, frame.color);
  if (depth_) list_ += ",";
  if (good_ && depth_ && !frame.depth.empty()) {
    const std::string depth = std::string("depth_") + number + ".png";
    list_ += depth;
    good_ = save_png(folder_ + "/" + depth, frame.depth);
  }
  list_ += "\n";
}

void FrameRecorder::on_frame(const FrameReport& frame, const TruthState& truth,
                             double) {
  if (!truth_.empty() && frame.t <= truth_.back().first) return;
  truth_.emplace_back(frame.t, truth.X_NB);
}

Result<int> FrameRecorder::finish() {
  if (!good_) return fail(good_.error());
  const std::pair<const char*, std::string> files[] = {
      {"truth.tum", tum_text(truth_)},
      {"rig.yaml", rig_text(options_.rig)},
      {"rig_true.yaml", rig_text(rig_true_)},
      {"scenario.yaml", scenario_text(options_.scenario)},
      {"frames.csv", list_},
  };
  for (const auto& [name, text] : files) {
    if (auto good = write_file(folder_ + "/" + name, text); !good) {
      return fail(good.error());
    }
  }
  return pictures_;
}

void Observers::on_world(const World& world) {
  for (RunObserver* observer : all_) observer->on_world(world);
}
void Observers::on_picture(const CameraFrame& frame) {
  for (RunObserver* observer : all_) observer->on_picture(frame);
}
void Observers::on_step(const Output& output, const TruthState& truth, double us) {
  for (RunObserver* observer : all_) observer->on_step(output, truth, us);
}
void Observers::on_frame(const FrameReport& frame, const TruthState& truth, double us) {
  for (RunObserver* observer : all_) observer->on_frame(frame, truth, us);
}
void Observers::on_plan(const PlanRequest& request, const PlanResult& result) {
  for (RunObserver* observer : all_) observer->on_plan(request, result);
}

}  // namespace alight
