// A program that is run for what it tells, and that may crash or never end.
#pragma once
#include <string>
#include <vector>

#include "runtime/system/system_process.h"

namespace vsplat {

using sys::WatchedEnd;

// Of its third descriptor the first mebibyte is kept, of its standard output and error the end. Error(internal) where
// it cannot be started.
WatchedEnd run_watched(const std::string& program, const std::vector<std::string>& arguments, double seconds);

}  // namespace vsplat
