// Programs of the user's that a command starts: they are found in PATH, write into a log that is read while they run,
// and are stopped with all that they have started when the user interrupts.
#pragma once
#include <filesystem>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

namespace command {

// "" if it is not set.
std::string environment_variable(const char* name);

// A program's path: as given if it has a slash, else in PATH; "" if it is not found.
std::string find_program(const std::string& program);

// Thrown when the user has interrupted a program, which has ended then.
class Interrupted : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("stopped") {}
};

struct ProgramOutput {
  std::string text;    // the end of what it printed
  std::string how;     // how it ended, for a message: "" if with exit code 0
  bool ended = false;  // with an exit code, not by a signal or the time limit
};

// Runs a program that prints little and ends soon. std::runtime_error if it cannot be started.
ProgramOutput output_of(const std::string& program, const std::vector<std::string>& arguments, double seconds);

// Runs a program whose output goes to `log`, a new file. `on_line` gets every line when it is there (lines that a
// carriage return ends, too). std::runtime_error if it cannot be started; Interrupted.
ProgramOutput run_logged(const std::string& program, const std::vector<std::string>& arguments,
                         const std::filesystem::path& log, const std::function<void(const std::string&)>& on_line);

// The last `count` lines of a text that are not empty, each indented by two blanks on a line of its own.
std::string last_lines(const std::string& text, std::size_t count);

}  // namespace command
