#include "program.h"

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include "alight/io/text.h"
#include "command.h"

namespace {

/// "alight eval", or "alight" when no command was recognized.
std::string title(const CLI::App& app) {
  const auto chosen = app.get_subcommands();
  return chosen.empty() ? "alight" : "alight " + chosen.front()->get_name();
}

/// Errors are one line, and what came out of a broken file does not reach the terminal.
std::string one_line(std::string text) {
  for (char& c : text) {
    if (std::iscntrl(static_cast<unsigned char>(c))) c = ' ';
  }
  return text;
}

/// What stands where a command should, said to be none; empty when nothing does.
std::string unknown_command(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return {};
  std::vector<std::string> known;
  for (const CLI::App* command : app.get_subcommands({})) {
    known.push_back(command->get_name());
  }
  const std::string word = argv[1];
  if (std::find(known.begin(), known.end(), word) != known.end()) return {};
  return alight::not_one_of(word, known);
}

/// @returns whether all that a command has said has got out.
bool flush_output() {
  std::cout.flush();
  return std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout.good();
}

}  // namespace

int run_program(int argc, char** argv) {
  CLI::App app{"Lands a quadrotor on a moving platform, seen by the platform's camera.",
               "alight"};
  app.require_subcommand(1);
  app.set_version_flag("--version", "alight " ALIGHT_VERSION);

  Job job;
  add_land(app, job);
  add_campaign(app, job);
  add_calibrate(app, job);
  add_track(app, job);
  add_detect(app, job);
  add_plan(app, job);
  add_render(app, job);
  add_measure(app, job);
  add_eval(app, job);
  add_reproduce(app, job);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& misuse) {
    if (misuse.get_exit_code() == 0) return app.exit(misuse);  // --help, --version
    const std::string unknown = unknown_command(app, argc, argv);
    std::cerr << title(app) << ": "
              << one_line(unknown.empty() ? misuse.what() : unknown) << " (see "
              << title(app) << " --help)\n";
    return 2;
  }

  // No exceptions of ours; memory may still run out, or a library throw.
  try {
    const auto done = job();
    const bool written = flush_output();
    if (!done) {
      std::cerr << title(app) << ": " << one_line(done.error().detail) << '\n';
      return 1;
    }
    if (!written) {
      std::cerr << title(app) << ": standard output: not all could be written to it\n";
      return 1;
    }
  } catch (const std::exception& wrong) {
    std::cerr << title(app) << ": " << one_line(wrong.what()) << '\n';
    return 1;
  }
  return 0;
}
