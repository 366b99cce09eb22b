// The reader's program: where it is, and how it is started.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace vsplat::read {

struct Started {
  std::string program;
  int process;  // -1: none that could be ended
  int socket;   // its other end is the program's third descriptor
};

// With that end of the socket and nothing else of what this process has open. Error(internal) where there is no such
// program, or it cannot be started.
Started start_program(const char* what, std::uint64_t memory);

// For tests: it is had by this instead. Empty: started again.
void set_start_program(std::function<Started(const char* what, std::uint64_t memory)> start);

}  // namespace vsplat::read
