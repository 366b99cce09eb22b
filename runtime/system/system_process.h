// Starts programs and reports how they end. A program inherits only what is stated here: no other open files of this
// process and no blocked signals. It gets its own process group, so that a terminal's signals reach only this process.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <system_error>
#include <vector>

#include "runtime/system/os_handle.h"

namespace vsplat::sys {

// ----------------------------------------------------------------------------------------------------------------
// a program to talk to

// Starts a program with one end of a channel (system_channel.h) as its third descriptor, its three standard streams
// connected to nothing, and our environment without variables whose names begin with `hidden` ("": all of it). Returns
// its process number; below 0 on an error.
int start_program(const std::string& program, const std::vector<std::string>& arguments, const Handle& channel,
                  const std::string& hidden, std::error_code& error);

// Starts a program without standard input that writes its output and errors to `log`. Returns its process number; below
// 0 on an error.
int start_logged_program(const std::string& program, const std::vector<std::string>& arguments, const Handle& log,
                         std::error_code& error);

enum class Wait { no, until_it_has_ended };
struct ProgramEnd {
  enum class State {
    runs,
    ended,
    unknown
  } state = State::unknown;  // unknown: not a child of this process, or no
                             // longer one
  int signal = 0;            // the signal that ended it
  int exit_code = -1;        // -1 if it did not end by itself
  bool fault = false;        // ended by a signal of a fault of its own
  bool out_of_time = false;  // ended by a signal of a time limit
};
// After a report that the program has ended, its number may belong to another process.
ProgramEnd end_of(int program, Wait wait);
void kill_program(int program);
// Asks the program to end, as a terminal's Ctrl-C does.
void stop_program(int program);
// The same two for a program together with all that it has started.
void kill_program_group(int program);
void stop_program_group(int program);
// Bytes that it has in memory; 0 if unknown.
std::uint64_t memory_of(int program);
std::string signal_name(int signal);

// ----------------------------------------------------------------------------------------------------------------
// a copy of this process

// Forks this process. Returns 0 in the new process, which is killed if this one ends first, its number in this one, and
// below 0 on an error. Allowed only while no other thread runs but the one that waits for signals (catch_stops() in
// system.h, which must be called again in the new process).
int split_process(std::error_code& error);

// ----------------------------------------------------------------------------------------------------------------
// a program in place of this process

// Runs a program in place of this process: with its number, its environment and its three standard streams. Returns
// only on an error. Signals that catch_stops() (system.h) waits for stay blocked until the program calls it, too.
std::error_code become_program(const std::string& program, const std::vector<std::string>& arguments);

// ----------------------------------------------------------------------------------------------------------------
// a program that runs for its output, through watched_process.h

struct Watch {
  std::size_t most_report = 0, most_said = 0;  // bytes kept: the first ones of `report`, and the last ones of `said`
  double seconds = 0;
};
struct WatchedEnd {
  std::string report;     // output to its third descriptor
  std::string said;       // its standard output and error
  int exit_code = -1;     // -1 if it did not end by itself, or if it is unknown how
  int signal = 0;         // the signal that ended it, unless we sent it
  bool too_late = false;  // it was killed after the time limit
  bool unknown = false;   // its exit status was lost: SIGCHLD is ignored, or a handler of the program took it
};
// Runs a program without standard input, and kills its whole process group after the time limit. At most one of the
// errors is set, if it was not started: `no_pipe` if there is no pipe for its output, else `not_started`.
WatchedEnd watch_program(const std::string& program, const std::vector<std::string>& arguments, const Watch& how,
                         std::error_code& no_pipe, std::error_code& not_started);

}  // namespace vsplat::sys
