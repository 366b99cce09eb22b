#include "runtime/system/watched_process.h"

#include "runtime/fail.h"

namespace vsplat {

WatchedEnd run_watched(const std::string& program, const std::vector<std::string>& arguments, double seconds) {
  constexpr std::size_t most_report = 1 << 20, most_said = 2000;
  std::error_code no_pipe, not_started;
  WatchedEnd out = sys::watch_program(program, arguments, {most_report, most_said, seconds}, no_pipe, not_started);
  if (no_pipe) fail(Status::internal, "{}: no pipe to hear from it: {}", program, no_pipe.message());
  if (not_started)
    fail(Status::internal, "{}: cannot be started: {}; this program is installed beside the library", program,
         not_started.message());
  return out;
}

}  // namespace vsplat
