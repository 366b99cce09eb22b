// What a process gives up before it reads what a stranger made.
#pragma once
#include <cstdint>

namespace vsplat::read {

enum Confinement : std::uint32_t {
  confined_by_limits = 1,    // of memory, files, processes
  confined_by_seccomp = 2,   // a few system calls are left: none that opens, starts or sends anything
  confined_by_landlock = 4,  // no file can be opened by its path
};

// -> what of it the system has: all of it, or less on an old kernel. `memory`: bytes of address space; not where the
// address sanitizer takes them all. `dies_with_parent`: at once, and it may compute for ten minutes at most.
std::uint32_t confine(std::uint64_t memory, bool dies_with_parent);

// So many bytes from now on.
void limit_memory(std::uint64_t bytes);

// Ends the process after so many seconds from now; 0: never.
void limit_time(unsigned seconds);
// So many more.
void more_time(unsigned seconds);

}  // namespace vsplat::read
