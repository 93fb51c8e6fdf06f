/// Bytes as a log of poses (TUM, the authors' CSV) and as a platform's drive.
#include <cmath>

#include "alight/eval/path_error.h"
#include "alight/io/pose_log.h"
#include "alight/sim/recorded_drive.h"
#include "tests/fuzz/input_file.h"

using namespace alight;

namespace {

void require_sound(const PoseLog& log, bool may_repeat) {
  require(!log.empty(), "an empty log is taken");
  for (std::size_t i = 0; i < log.size(); ++i) {
    const Matrix3 R = log[i].second.linear();
    require(log[i].second.matrix().allFinite(), "a pose is not finite");
    require((R * R.transpose()).isIdentity(1e-9), "a rotation is none");
    if (i == 0) continue;
    const Time step = log[i].first - log[i - 1].first;
    require(may_repeat ? step >= 0 : step > 0, "time runs backwards");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string path = input_file("log", data, size);
  const auto log = load_pose_log(path);
  if (log) {
    require_sound(log->poses, log->rows_match);
    require(log->frame_ms.empty() || log->frame_ms.size() == log->poses.size(),
            "times are not one a pose");
    const auto error = path_error(associate(log->poses, log->poses, 0.02));
    require(error && error->position_rmse_m < 1e-3, "a log is off from itself");
    if (!log->rows_match) {
      const std::string text = tum_text(log->poses);
      const auto again = load_tum(input_file("again.tum", text.data(), text.size()));
      require(again.has_value(), "what was written is not read");
      for (std::size_t i = 0; i < again->size(); ++i) {
        require((*again)[i].first == log->poses[i].first, "a time changes");
      }
    }
  } else {
    require_told(log.error(), path);
  }

  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto poses = parse_drive("drive", text);
  if (!poses) {
    require_told(poses.error(), "drive");
    return 0;
  }
  require_sound(*poses, false);
  const auto drive = RecordedDrive::create(*poses);
  if (!drive) return 0;
  for (double t = -1; t < 20; t += 0.37) {
    const PlatformState state = drive->at(t);
    require(state.X_IN.matrix().allFinite() && state.v_IN_N.allFinite() &&
                state.w_IN_N.allFinite() && state.a_IN_N.allFinite(),
            "the drive is not finite");
  }
  return 0;
}
