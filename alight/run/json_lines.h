#pragma once
#include <string>

#include "alight/mission/landing_io.h"

namespace alight {

/// A line of frames.jsonl (CONTRACT), newline included. `us` is what the step that used
/// the frame took; `used_t` when that step was.
std::string frame_line(const FrameReport& frame, Time used_t, double us);

/// A line of events.jsonl, newline included.
std::string transition_line(const MissionTransition& transition, int attempts);
std::string plan_line(Time t, const PlanResult& plan);

/// A line of trace.csv, one a step: reference, prediction, disturbance, what was sent.
std::string trace_header();
std::string trace_line(const Output& output);

}  // namespace alight
