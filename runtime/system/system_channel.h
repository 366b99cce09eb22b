// A channel between two processes, for bytes and open files: the calls that both ends use. system_channel_posix.cpp has
// no other dependencies, as the reader's program requires.
#pragma once
#include <cstddef>
#include <system_error>

#include "runtime/system/os_handle.h"

namespace vsplat::sys {

// Creates both ends; a started program inherits one if system_process.h says so.
std::error_code make_channel(Handle& one, Handle& other);

enum class Ready { yes, not_yet, failed };
enum class Way { in, out };
// Waits at most `milliseconds`, below 0 without limit. not_yet: no error, call again.
Ready wait_for(const Handle& end, Way way, int milliseconds);

struct Moved {
  bool open = true;       // false: the other end is closed
  std::size_t bytes = 0;  // 0: nothing could be moved yet
};
// Moves as many bytes as possible without waiting. `file` (a handle's number, below 0: none) is an open file that is
// sent with the first byte. The receiver gets it in `file`; if that is null, it takes no file.
Moved send_some(const Handle& end, const void* from, std::size_t bytes, int file = -1);
Moved receive_some(const Handle& end, void* to, std::size_t bytes, Handle* file = nullptr);

}  // namespace vsplat::sys
