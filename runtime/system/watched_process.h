// Runs a program for its output; the program may crash or hang.
#pragma once
#include <string>
#include <vector>

#include "runtime/system/system_process.h"

namespace vsplat {

using sys::WatchedEnd;

// Keeps the first mebibyte of its third descriptor's output, and the end of its standard output and error.
// Error(internal) if it cannot be started.
WatchedEnd run_watched(const std::string& program, const std::vector<std::string>& arguments, double seconds);

}  // namespace vsplat
