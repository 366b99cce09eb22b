#include "model/read/start_program.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <functional>
#include <utility>
#include <vector>

#include "model/read/channel.h"
#include "model/read/reader.h"
#include "runtime/fail.h"
#include "runtime/library_programs.h"

extern char** environ;

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

// Beside the library that this code is in, as both are installed.
std::string program_path() {
  if (!named_program().empty()) return named_program();
  const std::string path = library_program("vsplat-read");
  if (path.empty())
    fail(Status::internal,
         "meshes and HDF5 files are read by vsplat-read, which is installed beside the library: it is "
         "not known where that is");
  return path;
}

// What posix_spawn is told, freed at the end.
struct How {
  How() {
    ::posix_spawn_file_actions_init(&files);
    ::posix_spawnattr_init(&attributes);
  }
  ~How() {
    ::posix_spawn_file_actions_destroy(&files);
    ::posix_spawnattr_destroy(&attributes);
  }
  How(const How&) = delete;
  How& operator=(const How&) = delete;
  posix_spawn_file_actions_t files{};
  posix_spawnattr_t attributes{};
};

constexpr int program_socket = 3;

void give_descriptors(How& how, int socket) {
  ::posix_spawn_file_actions_adddup2(&how.files, socket, program_socket);
  for (const int standard : {0, 1, 2}) ::posix_spawn_file_actions_addopen(&how.files, standard, "/dev/null", O_RDWR, 0);
#if defined(__GLIBC__) && __GLIBC_PREREQ(2, 34)
  ::posix_spawn_file_actions_addclosefrom_np(&how.files, program_socket + 1);
#endif
}

// Signals as in a fresh program; of its own group, so that what the terminal sends reaches us, and we end it.
void give_signals(How& how) {
  sigset_t none, all;
  ::sigemptyset(&none);
  ::sigfillset(&all);
  ::posix_spawnattr_setsigmask(&how.attributes, &none);
  ::posix_spawnattr_setsigdefault(&how.attributes, &all);
  ::posix_spawnattr_setpgroup(&how.attributes, 0);
  ::posix_spawnattr_setflags(&how.attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
}

// Ours but for what would tell HDF5 where to look for other files and for code.
std::vector<char*> environment() {
  std::vector<char*> out;
  for (char** at = environ; at && *at; ++at)
    if (std::strncmp(*at, "HDF5_", 5) != 0) out.push_back(*at);
  out.push_back(nullptr);
  return out;
}

}  // namespace

void set_reader_program(const std::string& path) { named_program() = path; }

void read::set_start_program(std::function<Started(const char* what, std::uint64_t memory)> start) {
  replacement() = std::move(start);
}

read::Started read::start_program(const char* what, std::uint64_t memory) {
  if (replacement()) return replacement()(what, memory);
  const std::string program = program_path();
  int ends[2] = {-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    fail(Status::internal, "{}: no socket to talk to it: {}", program, std::strerror(errno));
  Descriptor ours(ends[0]), its(ends[1]);
  How how;
  give_descriptors(how, its.number());
  give_signals(how);
  const std::string bytes = std::to_string(memory);
  std::vector<char*> arguments;
  for (const char* argument : {program.c_str(), what, bytes.c_str(), static_cast<const char*>(nullptr)})
    arguments.push_back(const_cast<char*>(argument));
  pid_t process = -1;
  const int problem =
      ::posix_spawn(&process, program.c_str(), &how.files, &how.attributes, arguments.data(), environment().data());
  if (problem != 0)
    fail(Status::internal,
         "{}: cannot be started: {}; meshes and HDF5 files are read by this program, which is "
         "installed beside the library",
         program, std::strerror(problem));
  return {program, process, ours.release()};
}

}  // namespace vsplat
