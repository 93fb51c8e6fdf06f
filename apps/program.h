#pragma once

/// The whole program `alight`: reads the command line, does what it says.
/// @returns 0 done, 1 failed, 2 misused; then one line on standard error says what,
///          where and what to do.
int run_program(int argc, char** argv);
