#include "external_program.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <sstream>
#include <system_error>
#include <thread>

#include "command.h"
#include "runtime/system/system.h"
#include "runtime/system/system_process.h"

namespace command {
namespace {

namespace fs = std::filesystem;
namespace sys = vsplat::sys;

constexpr std::size_t most_kept = 1 << 16;  // bytes of a program's output

std::string how_it_ended(int exit_code, int signal) {
  if (signal != 0) return "ended by signal " + std::to_string(signal) + ", " + sys::signal_name(signal);
  return exit_code == 0 ? "" : "exit code " + std::to_string(exit_code);
}

// The growing text of a log, line by line.
class LogReader {
 public:
  LogReader(const fs::path& path, const std::function<void(const std::string&)>& on_line) : on_line_(on_line) {
    std::error_code error;
    file_ = sys::open_to_read(path, error);
    if (error) throw std::runtime_error(path.string() + ": " + error.message());
  }
  void read_on() {
    char piece[4096];
    std::error_code error;
    for (;;) {
      const std::size_t got = sys::read_at(file_, at_, piece, sizeof piece, error);
      at_ += got;
      for (std::size_t i = 0; i < got; ++i) take(piece[i]);
      if (got < sizeof piece) break;
    }
    if (kept_.size() > most_kept) kept_.erase(0, kept_.size() - most_kept);
  }
  const std::string& kept() const { return kept_; }

 private:
  void take(char c) {
    kept_ += c == '\r' ? '\n' : c;
    if (c != '\n' && c != '\r') {
      line_ += c;
      return;
    }
    if (!line_.empty()) on_line_(line_);
    line_.clear();
  }

  const std::function<void(const std::string&)>& on_line_;
  sys::Handle file_;
  std::uint64_t at_ = 0;
  std::string line_, kept_;
};

// Ends a program and what it has started: asks first, and kills what has not ended after three seconds.
void end_with_children(int process) {
  sys::stop_program_group(process);
  for (int i = 0; i < 60 && sys::end_of(process, sys::Wait::no).state == sys::ProgramEnd::State::runs; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  sys::kill_program_group(process);
}

}  // namespace

std::string environment_variable(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}

std::string find_program(const std::string& program) {
  constexpr fs::perms may_run = fs::perms::owner_exec | fs::perms::group_exec | fs::perms::others_exec;
  const auto is_program = [](const fs::path& path) {
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    return fs::is_regular_file(status) && (status.permissions() & may_run) != fs::perms::none;
  };
  if (program.find('/') != std::string::npos) return is_program(program) ? program : "";
  std::istringstream folders(environment_variable("PATH"));
  for (std::string folder; std::getline(folders, folder, ':');)
    if (!folder.empty() && is_program(fs::path(folder) / program)) return (fs::path(folder) / program).string();
  return "";
}

ProgramOutput output_of(const std::string& program, const std::vector<std::string>& arguments, double seconds) {
  std::error_code no_pipe, not_started;
  const sys::WatchedEnd end = sys::watch_program(program, arguments, {0, most_kept, seconds}, no_pipe, not_started);
  if (no_pipe || not_started)
    throw std::runtime_error(program + ": cannot be started: " + (no_pipe ? no_pipe : not_started).message());
  const std::string how =
      end.too_late ? "no end after " + seconds_text(seconds) : how_it_ended(end.exit_code, end.signal);
  return {end.said, how, !end.too_late && end.signal == 0};
}

ProgramOutput run_logged(const std::string& program, const std::vector<std::string>& arguments, const fs::path& log,
                         const std::function<void(const std::string&)>& on_line) {
  std::error_code error;
  const sys::Handle file = sys::create_new(log, sys::Whose::everybody, error);
  if (error) throw std::runtime_error(log.string() + ": " + error.message());
  LogReader reader(log, on_line);
  const int process = sys::start_logged_program(program, arguments, file, error);
  if (process < 0) throw std::runtime_error(program + ": cannot be started: " + error.message());
  for (;;) {
    if (interrupted()) {
      end_with_children(process);
      throw Interrupted();
    }
    const sys::ProgramEnd end = sys::end_of(process, sys::Wait::no);
    reader.read_on();
    if (end.state != sys::ProgramEnd::State::runs)
      return {reader.kept(), how_it_ended(end.exit_code, end.signal), end.signal == 0};
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
}

std::string last_lines(const std::string& text, std::size_t count) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);)
    if (line.find_first_not_of(" \t\r") != std::string::npos) lines.push_back(line);
  std::string out;
  for (std::size_t i = lines.size() - std::min(count, lines.size()); i < lines.size(); ++i) out += "\n  " + lines[i];
  return out;
}

}  // namespace command
