// Programs that are started, and how they end. What a program gets is what is said here: of what this process has open
// nothing else, no signals that are held back, a group of its own, so that what a terminal sends reaches us alone.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <system_error>
#include <vector>

#include "runtime/handle.h"

namespace vsplat::sys {

// ----------------------------------------------------------------------------------------------------------------
// one that is talked to

// With one end of a channel (system_channel.h) as its third descriptor, the standard three to and from nowhere, and our
// variables but those whose names begin with `hidden` ("": all). -> its number; below 0 on an error.
int start_program(const std::string& program, const std::vector<std::string>& arguments, const Handle& channel,
                  const std::string& hidden, std::error_code& error);

enum class Wait { no, until_it_has_ended };
struct ProgramEnd {
  enum class State { runs, ended, unknown } state = State::unknown;  // unknown: it is none of ours, or no longer
  int signal = 0;                                                    // that ended it
  int exit_code = -1;                                                // -1 where it did not end by itself
  bool fault = false;                                                // by such a signal as comes of its own doing
  bool out_of_time = false;                                          // by such a signal
};
// Once it has ended its number is no longer its own.
ProgramEnd end_of(int program, Wait wait);
void kill_program(int program);
// Asks it to end, as a terminal's Ctrl-C does.
void stop_program(int program);
// Bytes that it has in memory; 0 where that is not known.
std::uint64_t memory_of(int program);
std::string signal_name(int signal);

// ----------------------------------------------------------------------------------------------------------------
// this one again

// From here on there are two of this process: 0 in the new one, which is killed where this one ends before it, and in
// this one its number; below 0 on an error. Only in a process in which nothing else runs but what waits for signals
// (catch_stops() in system.h, which is to be called again in the new one).
int split_process(std::error_code& error);

// ----------------------------------------------------------------------------------------------------------------
// one that is run for what it tells, by watched_process.h

struct Watch {
  std::size_t most_told = 0, most_said = 0;  // bytes that are kept: the first ones, and the last ones
  double seconds = 0;
};
struct WatchedEnd {
  std::string told;       // of its third descriptor
  std::string said;       // of its standard output and error
  int exit_code = -1;     // -1 where it did not end by itself, or nobody knows how
  int signal = 0;         // that ended it, but for ours
  bool too_late = false;  // it was ended after the time
  bool unknown = false;   // it ended, and how has been taken from us: where SIGCHLD is ignored, by a program's handler
};
// With standard input from nowhere; all of its group is ended after that time. Of the errors one where it was not
// started: for want of a pipe to hear from it, or by itself.
WatchedEnd watch_program(const std::string& program, const std::vector<std::string>& arguments, const Watch& how,
                         std::error_code& no_pipe, std::error_code& not_started);

}  // namespace vsplat::sys
