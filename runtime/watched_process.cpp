#include "runtime/watched_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>

#include "runtime/fail.h"

extern char** environ;

namespace vsplat {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int told_descriptor = 3;
constexpr std::size_t most_told = 1 << 20, most_said = 2000;

class Pipe {
 public:
  explicit Pipe(const std::string& program) {
    if (::pipe2(ends_, O_CLOEXEC) != 0)
      fail(Status::internal, "{}: no pipe to hear from it: {}", program, std::strerror(errno));
    // Beyond what the program's descriptors are set to, so that none of them is in the way of another.
    for (int& end : ends_) {
      const int above = ::fcntl(end, F_DUPFD_CLOEXEC, 10);
      if (above < 0) continue;
      ::close(end);
      end = above;
    }
  }
  ~Pipe() {
    close_end(0);
    close_end(1);
  }
  Pipe(const Pipe&) = delete;
  Pipe& operator=(const Pipe&) = delete;
  int end(int which) const { return ends_[which]; }
  void close_end(int which) {
    if (ends_[which] >= 0) ::close(ends_[which]);
    ends_[which] = -1;
  }

 private:
  int ends_[2] = {-1, -1};
};

// What posix_spawn is told, freed at the end. Signals as in a fresh program.
struct Spawning {
  Spawning(const Pipe& told, const Pipe& said) {
    ::posix_spawn_file_actions_init(&files);
    ::posix_spawn_file_actions_addopen(&files, 0, "/dev/null", O_RDONLY, 0);
    ::posix_spawn_file_actions_adddup2(&files, said.end(1), 1);
    ::posix_spawn_file_actions_adddup2(&files, said.end(1), 2);
    ::posix_spawn_file_actions_adddup2(&files, told.end(1), told_descriptor);
#if defined(__GLIBC__) && __GLIBC_PREREQ(2, 34)
    ::posix_spawn_file_actions_addclosefrom_np(&files, told_descriptor + 1);
#endif
    sigset_t none, all;
    ::sigemptyset(&none);
    ::sigfillset(&all);
    ::posix_spawnattr_init(&attributes);
    ::posix_spawnattr_setsigmask(&attributes, &none);
    ::posix_spawnattr_setsigdefault(&attributes, &all);
    ::posix_spawnattr_setpgroup(&attributes, 0);
    ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  }
  ~Spawning() {
    ::posix_spawn_file_actions_destroy(&files);
    ::posix_spawnattr_destroy(&attributes);
  }
  Spawning(const Spawning&) = delete;
  Spawning& operator=(const Spawning&) = delete;
  posix_spawn_file_actions_t files{};
  posix_spawnattr_t attributes{};
};

// Takes what is there. -> false at the end.
bool take(int from, std::string& into, bool keep_end, std::size_t most) {
  char piece[4096];
  const ssize_t got = ::read(from, piece, sizeof piece);
  if (got < 0) return errno == EINTR || errno == EAGAIN;
  if (got == 0) return false;
  into.append(piece, static_cast<std::size_t>(got));
  if (into.size() > most && keep_end) into.erase(0, into.size() - most);
  if (into.size() > most) into.resize(most);
  return true;
}

int milliseconds_to(Clock::time_point end) {
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
  return left > 0 ? static_cast<int>(left) + 1 : 0;
}

// Until the program has ended or the time has. Descriptors may stay open in what a driver has started: the end of the
// program itself counts. It is left as it ended, so that its number stays its own. Says whether it goes on, or is gone.
void listen(const Pipe& told, const Pipe& said, pid_t process, Clock::time_point end, WatchedEnd& out) {
  bool told_open = true, said_open = true, ended = false;
  for (;;) {
    siginfo_t found{};
    if (!ended && ::waitid(P_PID, static_cast<id_t>(process), &found, WEXITED | WNOHANG | WNOWAIT) != 0)
      ended = out.unknown = errno == ECHILD;
    ended = ended || found.si_pid == process;
    pollfd files[2] = {{told_open ? told.end(0) : -1, POLLIN, 0}, {said_open ? said.end(0) : -1, POLLIN, 0}};
    const int ready = ::poll(files, 2, ended ? 0 : std::min(milliseconds_to(end), 50));
    if (ready > 0 && files[0].revents != 0) told_open = take(told.end(0), out.told, false, most_told);
    if (ready > 0 && files[1].revents != 0) said_open = take(said.end(0), out.said, true, most_said);
    if (ended && ready <= 0) return;
    if (!ended && Clock::now() >= end) {
      out.too_late = true;
      return;
    }
  }
}

}  // namespace

WatchedEnd run_watched(const std::string& program, const std::vector<std::string>& arguments, double seconds) {
  Pipe told(program), said(program);
  const Spawning how(told, said);
  std::vector<char*> words = {const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  pid_t process = -1;
  const int problem = ::posix_spawn(&process, program.c_str(), &how.files, &how.attributes, words.data(), environ);
  if (problem != 0)
    fail(Status::internal, "{}: cannot be started: {}; this program is installed beside the library", program,
         std::strerror(problem));
  told.close_end(1);
  said.close_end(1);
  WatchedEnd out;
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  listen(told, said, process, end, out);
  if (out.unknown) return out;  // its number may be somebody else's by now
  ::kill(-process, SIGKILL);    // and what it may have started
  int status = 0;
  pid_t got = -1;
  do {
    got = ::waitpid(process, &status, 0);
  } while (got < 0 && errno == EINTR);
  if (out.too_late) return out;
  out.unknown = got != process;
  if (out.unknown) return out;
  if (WIFEXITED(status)) out.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) out.signal = WTERMSIG(status);
  return out;
}

}  // namespace vsplat
