// A channel between two processes, which takes bytes and files that are open: what both of its ends call. Whoever links
// system_channel_posix.cpp gets nothing else with it, as the reader's program needs it to be.
#pragma once
#include <cstddef>
#include <system_error>

#include "runtime/handle.h"

namespace vsplat::sys {

// Both ends; a program that is started gets one where system_process.h says so.
std::error_code make_channel(Handle& one, Handle& other);

enum class Ready { yes, not_yet, failed };
enum class Way { in, out };
// Waits so many milliseconds at the most, below 0 for as long as it takes; not_yet: look again, nothing is wrong.
Ready wait_for(const Handle& end, Way way, int milliseconds);

struct Moved {
  bool open = true;       // false: the other end is closed
  std::size_t bytes = 0;  // none: not yet
};
// As much as goes at once, without waiting. With the first byte goes the open file `file`, by its number (below 0:
// none); it comes to `file` where that is not null, and where it is, none is taken.
Moved send_some(const Handle& end, const void* from, std::size_t bytes, int file = -1);
Moved receive_some(const Handle& end, void* to, std::size_t bytes, Handle* file = nullptr);

}  // namespace vsplat::sys
