// Drops a process's privileges before it reads untrusted files.
#pragma once
#include <cstdint>

namespace vsplat::read {

enum Confinement : std::uint32_t {
  confined_by_limits = 1,    // limits on memory, files and processes
  confined_by_seccomp = 2,   // only a few system calls remain: none that opens, starts or connects anything
  confined_by_landlock = 4,  // no file can be opened by path
};

// Returns the measures that took effect: all of them, or fewer on an old kernel. `memory`: limit on the address space
// in bytes, which is not set under the address sanitizer. `dies_with_parent`: the process is killed when its parent
// ends, and may use at most ten minutes of CPU time.
std::uint32_t confine(std::uint64_t memory, bool dies_with_parent);

// Sets the limit on the address space, in bytes.
void limit_memory(std::uint64_t bytes);

// Ends the process after this many seconds; 0: never.
void limit_time(unsigned seconds);
// Extends the time limit by this many seconds.
void more_time(unsigned seconds);

}  // namespace vsplat::read
