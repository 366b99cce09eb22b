// Locates and starts the reader program.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace vsplat::read {

struct Started {
  std::string program;
  int process;  // -1: no process to end
  int socket;   // the other end is the program's descriptor 3
};

// Starts the program with its end of the socket and no other open file of this process. Error(internal) if the program
// does not exist or cannot be started.
Started start_program(const char* what, std::uint64_t memory);

// For tests: start_program() calls this instead; empty restores the default.
void set_start_program(std::function<Started(const char* what, std::uint64_t memory)> start);

}  // namespace vsplat::read
