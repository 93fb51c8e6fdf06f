#pragma once
#include <string>
#include <string_view>
#include <vector>

#include "alight/base/result.h"
#include "alight/geometry/pose_log.h"

namespace alight {

/// TUM file: `t tx ty tz qx qy qz qw` a line, '#' begins a comment. Quaternions are
/// normalized; one of norm 0 is an error, as are NaN, a wrong number of fields, time
/// that does not advance and what cannot be in s and m (parse_time; 1e9 m).
Result<PoseLog> load_tum(const std::string& path);

/// Nine digits of time, so that it reads back to the nanosecond.
std::string tum_text(const PoseLog& log);
Result<void> save_tum(const std::string& path, const PoseLog& log);

/// A log with what the program took for each frame, where the file says.
struct RunLog {
  PoseLog poses;
  std::vector<double> frame_ms;  ///< As long as `poses`, or empty.
  bool rows_match = false;       ///< Row i of estimate and truth are of one instant.
};

/// The paper's authors' CSV logs: the first line is a file name, the second the header,
/// which has `y` twice (position and yaw) and is therefore read by place; rows end in a
/// comma. Roll, pitch, yaw in rad; the column `ms` holds seconds. Rows may repeat an
/// instant.
Result<RunLog> load_authors_csv(const std::string& path);

/// A platform's drive, X_IN: a table with the header `t,x,y,z,yaw_deg` (s, m; level),
/// or a TUM file. `name` stands for the file in complaints.
Result<PoseLog> parse_drive(const std::string& name, std::string_view text);

/// Either of the first two, told apart by content.
Result<RunLog> load_pose_log(const std::string& path);

}  // namespace alight
