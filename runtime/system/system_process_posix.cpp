// Programs on POSIX, started with posix_spawn, which is safe in a process with threads.
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#ifdef __linux__
#include <sys/prctl.h>
#endif
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>

#include "runtime/system/system_process.h"

extern char** environ;

namespace vsplat::sys {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int third_descriptor = 3;

// The words of a program's command line, as C has them; the strings have to outlive them.
std::vector<char*> words_of(const std::string& program, const std::vector<std::string>& arguments) {
  std::vector<char*> words = {const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  return words;
}

// Attributes for posix_spawn, freed on destruction. The program has default signals and its own process group, so that
// a terminal's signals reach only us, and we end it.
struct Spawning {
  Spawning() {
    ::posix_spawn_file_actions_init(&files);
    ::posix_spawnattr_init(&attributes);
    sigset_t none, all;
    ::sigemptyset(&none);
    ::sigfillset(&all);
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

  void nowhere(int descriptor, int flags) {
    ::posix_spawn_file_actions_addopen(&files, descriptor, "/dev/null", flags, 0);
  }
  void give(const Handle& ours, int descriptor) {
    ::posix_spawn_file_actions_adddup2(&files, ours.number(), descriptor);
  }
  void nothing_else() {
#if defined(__GLIBC__) && __GLIBC_PREREQ(2, 34)
    ::posix_spawn_file_actions_addclosefrom_np(&files, third_descriptor + 1);
#endif
  }
  // A null ends `variables`.
  int start(const std::string& program, const std::vector<std::string>& arguments, char* const* variables,
            std::error_code& error) const {
    const std::vector<char*> words = words_of(program, arguments);
    pid_t process = -1;
    const int problem = ::posix_spawn(&process, program.c_str(), &files, &attributes, words.data(), variables);
    error = {problem, std::generic_category()};
    return problem == 0 ? process : -1;
  }

  posix_spawn_file_actions_t files{};
  posix_spawnattr_t attributes{};
};

pid_t wait_for_end(int program, int& status, int flags) {
  pid_t out = -1;
  do {
    out = ::waitpid(program, &status, flags);
  } while (out < 0 && errno == EINTR);
  return out;
}

struct Pipe {
  Handle from, to;
};

std::error_code open_pipe(Pipe& out) {
  int ends[2] = {-1, -1};
  if (::pipe2(ends, O_CLOEXEC) != 0) return {errno, std::generic_category()};
  out.from = Handle(ends[0]), out.to = Handle(ends[1]);
  // Numbers above the program's descriptors, so that they cannot collide.
  for (Handle* end : {&out.from, &out.to})
    if (Handle above(::fcntl(end->number(), F_DUPFD_CLOEXEC, 10)); above.good()) *end = std::move(above);
  return {};
}

// Reads what is available. Returns false at the end.
bool take(const Handle& from, std::string& into, bool keep_end, std::size_t most) {
  char piece[4096];
  const ssize_t got = ::read(from.number(), piece, sizeof piece);
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

// Reads until the program has ended or the time is up. Programs that a driver started may keep descriptors open, so the
// end of the program itself counts. Its exit status is not collected, so that its number stays reserved. Returns
// whether the program still runs, or is gone.
void listen(const Handle& report, const Handle& said, int process, Clock::time_point end, const Watch& how,
            WatchedEnd& out) {
  bool report_open = true, said_open = true, ended = false;
  for (;;) {
    siginfo_t found{};
    if (!ended && ::waitid(P_PID, static_cast<id_t>(process), &found, WEXITED | WNOHANG | WNOWAIT) != 0)
      ended = out.unknown = errno == ECHILD;
    ended = ended || found.si_pid == process;
    pollfd files[2] = {{report_open ? report.number() : -1, POLLIN, 0}, {said_open ? said.number() : -1, POLLIN, 0}};
    const int ready = ::poll(files, 2, ended ? 0 : std::min(milliseconds_to(end), 50));
    if (ready > 0 && files[0].revents != 0) report_open = take(report, out.report, false, how.most_report);
    if (ready > 0 && files[1].revents != 0) said_open = take(said, out.said, true, how.most_said);
    if (ended && ready <= 0) return;
    if (!ended && Clock::now() >= end) {
      out.too_late = true;
      return;
    }
  }
}

}  // namespace

int start_program(const std::string& program, const std::vector<std::string>& arguments, const Handle& channel,
                  const std::string& hidden, std::error_code& error) {
  Spawning how;
  how.give(channel, third_descriptor);
  for (const int standard : {0, 1, 2}) how.nowhere(standard, O_RDWR);
  how.nothing_else();
  std::vector<char*> variables;
  for (char** at = environ; at && *at; ++at)
    if (hidden.empty() || std::strncmp(*at, hidden.c_str(), hidden.size()) != 0) variables.push_back(*at);
  variables.push_back(nullptr);
  return how.start(program, arguments, variables.data(), error);
}

int start_logged_program(const std::string& program, const std::vector<std::string>& arguments, const Handle& log,
                         std::error_code& error) {
  Spawning how;
  how.nowhere(0, O_RDONLY);
  how.give(log, 1);
  how.give(log, 2);
  how.nowhere(third_descriptor, O_RDWR);
  how.nothing_else();
  return how.start(program, arguments, environ, error);
}

ProgramEnd end_of(int program, Wait wait) {
  ProgramEnd out;
  int status = 0;
  const pid_t ended = wait == Wait::no ? ::waitpid(program, &status, WNOHANG) : wait_for_end(program, status, 0);
  if (ended == 0) out.state = ProgramEnd::State::runs;
  if (ended == 0 || ended != program) return out;
  out.state = ProgramEnd::State::ended;
  if (WIFSIGNALED(status)) out.signal = WTERMSIG(status);
  if (WIFEXITED(status)) out.exit_code = WEXITSTATUS(status);
  for (const int own : {SIGSEGV, SIGBUS, SIGILL, SIGFPE, SIGABRT, SIGTRAP, SIGSYS}) out.fault |= out.signal == own;
  out.out_of_time = out.signal == SIGALRM || out.signal == SIGXCPU;
  return out;
}

void kill_program(int program) { ::kill(program, SIGKILL); }

void stop_program(int program) { ::kill(program, SIGTERM); }

void kill_program_group(int program) { ::kill(-program, SIGKILL); }

void stop_program_group(int program) { ::kill(-program, SIGTERM); }

int split_process(std::error_code& error) {
  std::signal(SIGCHLD, SIG_DFL);  // a process that ignores it never learns how one ended
  const pid_t before = ::getpid();
  const pid_t out = ::fork();
  error = {out < 0 ? errno : 0, std::generic_category()};
#ifdef __linux__
  if (out == 0 && (::prctl(PR_SET_PDEATHSIG, SIGKILL) != 0 || ::getppid() != before)) ::_exit(1);
#endif
  return out;
}

std::error_code become_program(const std::string& program, const std::vector<std::string>& arguments) {
  ::execv(program.c_str(), words_of(program, arguments).data());
  return {errno, std::generic_category()};
}

std::uint64_t memory_of(int program) {
  std::FILE* file = std::fopen(("/proc/" + std::to_string(program) + "/statm").c_str(), "re");
  if (!file) return 0;
  unsigned long whole = 0, resident = 0;
  const bool known = std::fscanf(file, "%lu %lu", &whole, &resident) == 2;
  std::fclose(file);
  return known ? resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE)) : 0;
}

std::string signal_name(int signal) { return ::strsignal(signal); }

WatchedEnd watch_program(const std::string& program, const std::vector<std::string>& arguments, const Watch& how,
                         std::error_code& no_pipe, std::error_code& not_started) {
  WatchedEnd out;
  Pipe report, said;
  not_started.clear();
  no_pipe = open_pipe(report);
  if (!no_pipe) no_pipe = open_pipe(said);
  if (no_pipe) return out;
  int process = -1;
  {
    Spawning spawning;
    spawning.nowhere(0, O_RDONLY);
    spawning.give(said.to, 1);
    spawning.give(said.to, 2);
    spawning.give(report.to, third_descriptor);
    spawning.nothing_else();
    process = spawning.start(program, arguments, environ, not_started);
  }
  if (not_started) return out;
  report.to = Handle(), said.to = Handle();
  const auto end =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(how.seconds));
  listen(report.from, said.from, process, end, how, out);
  if (out.unknown) return out;  // its number may belong to another process by now
  ::kill(-process, SIGKILL);    // including processes that it may have started
  int status = 0;
  const pid_t got = wait_for_end(process, status, 0);
  if (out.too_late) return out;
  out.unknown = got != process;
  if (out.unknown) return out;
  if (WIFEXITED(status)) out.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) out.signal = WTERMSIG(status);
  return out;
}

}  // namespace vsplat::sys
