#include "model/io/reader/start_program.h"

#include <functional>
#include <utility>

#include "model/io/reader/reader.h"
#include "runtime/fail.h"
#include "runtime/library_programs.h"
#include "runtime/system/system_channel.h"
#include "runtime/system/system_process.h"

namespace vsplat {
namespace {

std::string& named_program() {
  static std::string path;
  return path;
}

std::function<read::Started(const char* what, std::uint64_t memory)>& replacement() {
  static std::function<read::Started(const char* what, std::uint64_t memory)> start;
  return start;
}

// The program beside the library that contains this code, as both are installed.
std::string program_path() {
  if (!named_program().empty()) return named_program();
  const std::string path = library_program("vsplat-read");
  if (path.empty())
    fail(Status::internal,
         "vsplat-read, which reads meshes and HDF5 files, is installed beside the library, but the library's path is "
         "unknown");
  return path;
}

}  // namespace

void set_reader_program(const std::string& path) { named_program() = path; }

void read::set_start_program(std::function<Started(const char* what, std::uint64_t memory)> start) {
  replacement() = std::move(start);
}

read::Started read::start_program(const char* what, std::uint64_t memory) {
  if (replacement()) return replacement()(what, memory);
  const std::string program = program_path();
  sys::Handle ours, its;
  std::error_code problem = sys::make_channel(ours, its);
  if (problem) fail(Status::internal, "{}: no socket to talk to it: {}", program, problem.message());
  // Drops our HDF5_ environment variables, which would tell HDF5 where to look for other files and for code.
  const int process = sys::start_program(program, {what, std::to_string(memory)}, its, "HDF5_", problem);
  if (problem)
    fail(Status::internal,
         "{}: cannot be started: {}; this program, which is installed beside the library, reads meshes and HDF5 files",
         program, problem.message());
  return {program, process, ours.release()};
}

}  // namespace vsplat
