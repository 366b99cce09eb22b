// Parses a command line, does what it asks for, and turns errors into exit codes: 0 on success, 1 if something failed,
// 2 if the request itself is wrong, 128 plus the signal's number if a signal stopped it.
#pragma once
#include <string>
#include <vector>

#include "command.h"

namespace command {

// Returns the exit code. `run` is what the sub-command sets when `app` parses the arguments `given`.
int carry_out(CLI::App& app, const Run& run, const std::vector<std::string>& given);

}  // namespace command
