#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "alight/io/rig_yaml.h"
#include "alight/run/sequence.h"
#include "checks.h"

/// What the commands that render flights ask in common, as typed.
struct SequenceSettings {
  alight::SequenceOptions options;
  std::string rig, kind = "clean";
  std::vector<double> blackout;

  void add_to(CLI::App& command) {
    command.add_option("--kind", kind, "clean or hard")
        ->check(CLI::IsMember({"clean", "hard"}))
        ->capture_default_str();
    command.add_option("--rig", rig, "Rig file; the authors' by default")
        ->check(named());
    command.add_option("--frames", options.frames, "Pictures, at the rig's rate")
        ->check(within(1, alight::SequenceOptions::kFramesMost))
        ->capture_default_str();
    command
        .add_option("--lights", options.lights, "Pieces of ceiling lights in the room")
        ->check(within(0, alight::SequenceOptions::kLightsMost))
        ->capture_default_str();
    command.add_option("--stray", options.strays, "Single lamps more, in the picture")
        ->check(within(0, alight::SequenceOptions::kLightsMost))
        ->capture_default_str();
    command.add_option("--dead", options.dead, "LEDs that do not shine: i,j,..")
        ->check(within(0, alight::kMaxLeds - 1))
        ->delimiter(',');
    command
        .add_option("--blackout", blackout,
                    "No LED shines from t0 to t1, s after the begin: t0,t1")
        ->delimiter(',')
        ->expected(2)
        ->check(within(0, 1e6));
    command
        .add_option("--led-error-mm", options.led_error_mm,
                    "sd of the LEDs' places about the rig file, each axis")
        ->check(within(0, alight::SequenceOptions::kLedErrorMost_mm))
        ->capture_default_str();
    command
        .add_option("--range-m", options.path.range_max_m, "Farthest from the lens, m")
        ->check(within(options.path.range_min_m + alight::FlightPathConfig::kRoom_m,
                       alight::FlightPathConfig::kRangeMost_m))
        ->capture_default_str();
    command.add_option("--speed-m-s", options.path.speed_m_s, "Top speed, m/s")
        ->check(within(alight::FlightPathConfig::kSpeedLeast_m_s,
                       alight::FlightPathConfig::kSpeedMost_m_s))
        ->capture_default_str();
  }

  /// The options complete, rig read.
  alight::Result<alight::SequenceOptions> resolved() const {
    alight::SequenceOptions all = options;
    all.rig = alight::alan_rig();
    if (!rig.empty()) {
      auto loaded = alight::load_rig(rig);
      if (!loaded) return alight::fail(loaded.error());
      all.rig = *loaded;
    }
    all.kind = *alight::sequence_kind(kind);
    if (!blackout.empty()) {
      if (blackout[1] < blackout[0]) {
        return alight::fail(alight::Fault::invalid_config,
                            "--blackout: ends before it begins");
      }
      all.dark_from = blackout[0];
      all.dark_to = blackout[1];
    }
    return all;
  }
};
