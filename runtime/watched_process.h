// A program that is run for what it tells, and that may crash or never end.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

struct WatchedEnd {
  std::string told;       // all of its third descriptor, up to a mebibyte
  std::string said;       // the end of its standard output and error
  int exit_code = -1;     // -1 where it did not end by itself, or nobody knows how
  int signal = 0;         // that ended it, but for ours
  bool too_late = false;  // it was ended after the time
  bool unknown = false;   // it ended, and how has been taken from us: where SIGCHLD is ignored, by a program's handler
};

// With standard input from /dev/null, a group of its own, and nothing else of what this process has open; all of the
// group is ended after `seconds`. Error(internal) where it cannot be started.
WatchedEnd run_watched(const std::string& program, const std::vector<std::string>& arguments, double seconds);

}  // namespace vsplat
