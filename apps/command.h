#pragma once
#include <CLI/CLI.hpp>
#include <functional>
#include <string>

#include "alight/base/result.h"

/// What a command does once its line has been understood. A failure's text goes to
/// standard error as "alight NAME: text", exit status 1.
using Job = std::function<alight::Result<void>()>;

/// Each adds one command to the program and sets `job` when it is the one chosen.
void add_eval(CLI::App& app, Job& job);
void add_track(CLI::App& app, Job& job);
void add_detect(CLI::App& app, Job& job);
void add_plan(CLI::App& app, Job& job);
void add_land(CLI::App& app, Job& job);
void add_campaign(CLI::App& app, Job& job);
void add_calibrate(CLI::App& app, Job& job);
void add_render(CLI::App& app, Job& job);
void add_measure(CLI::App& app, Job& job);
void add_reproduce(CLI::App& app, Job& job);
