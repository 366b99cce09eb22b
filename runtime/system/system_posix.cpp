// The operating system on POSIX, with extensions of Linux and its C library.
#include <dlfcn.h>
#include <fcntl.h>
#include <gnu/libc-version.h>
#include <grp.h>
#include <pwd.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>
#include <utility>

#include "runtime/system/system.h"

namespace vsplat::sys {
namespace {

namespace fs = std::filesystem;

std::error_code last_error() { return {errno, std::generic_category()}; }

// The error of a call that returned 0 or -1.
std::error_code error_of(int result) { return result == 0 ? std::error_code() : last_error(); }

FileFacts facts_in(const struct stat& found) {
  FileFacts out;
  out.kind = S_ISREG(found.st_mode)   ? FileFacts::Kind::file
             : S_ISDIR(found.st_mode) ? FileFacts::Kind::folder
                                      : FileFacts::Kind::other;
  out.device = found.st_dev, out.node = found.st_ino;
  out.size = static_cast<std::uint64_t>(found.st_size);
  out.changed = found.st_mtim.tv_sec, out.changed_ns = found.st_mtim.tv_nsec;
  out.ours_alone = (found.st_uid == ::geteuid() || found.st_uid == 0) && (found.st_mode & (S_IWGRP | S_IWOTH)) == 0;
  return out;
}

Handle opened(const fs::path& path, int flags, std::error_code& error, mode_t mode = 0) {
  Handle out(::open(path.c_str(), flags | O_CLOEXEC, mode));
  error = out.good() ? std::error_code() : last_error();
  return out;
}

mode_t of_all(Whose whose, mode_t everybody, mode_t owner) { return whose == Whose::owner ? owner : everybody; }

std::string text_of(const char* text) { return text ? text : ""; }

}  // namespace

// ----------------------------------------------------------------------------------------------------------------
// files and folders

std::optional<FileFacts> facts_of(const fs::path& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0) return std::nullopt;
  return facts_in(found);
}

std::optional<FileFacts> facts_of_entry(const fs::path& path) {
  struct stat found {};
  if (::lstat(path.c_str(), &found) != 0) return std::nullopt;
  return facts_in(found);
}

std::optional<FileFacts> facts_of(const Handle& opened, std::error_code& error) {
  struct stat found {};
  error = error_of(::fstat(opened.number(), &found));
  if (error) return std::nullopt;
  return facts_in(found);
}

std::optional<FileFacts> facts_of(std::FILE* opened) {
  struct stat found {};
  if (::fstat(::fileno(opened), &found) != 0) return std::nullopt;
  return facts_in(found);
}

Handle open_to_read(const fs::path& path, std::error_code& error, Links links) {
  // O_NONBLOCK: does not wait for a pipe's writer, and has no effect on a regular file. O_NOCTTY: a terminal does not
  // become this process's.
  return opened(path, O_RDONLY | O_NONBLOCK | O_NOCTTY | (links == Links::refused ? O_NOFOLLOW : 0), error);
}

Handle open_folder(const fs::path& path, std::error_code& error) { return opened(path, O_RDONLY | O_DIRECTORY, error); }

Handle create_new(const fs::path& path, Whose whose, std::error_code& error) {
  return opened(path, O_WRONLY | O_CREAT | O_EXCL, error, of_all(whose, 0666, 0600));
}

std::FILE* stream(Handle opened, const char* mode, std::error_code& error) {
  std::FILE* out = ::fdopen(opened.number(), mode);
  error = out ? std::error_code() : last_error();
  if (out) opened.release();
  return out;
}

int number_of(std::FILE* opened) { return ::fileno(opened); }

std::size_t read_at(const Handle& file, std::uint64_t offset, void* to, std::size_t bytes, std::error_code& error) {
  error.clear();
  std::size_t have = 0;
  while (have < bytes) {
    const ssize_t got =
        ::pread(file.number(), static_cast<char*>(to) + have, bytes - have, static_cast<off_t>(offset + have));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) error = last_error();
    if (got <= 0) break;
    have += static_cast<std::size_t>(got);
  }
  return have;
}

std::error_code seek(std::FILE* file, std::uint64_t offset) {
  return error_of(::fseeko(file, static_cast<off_t>(offset), SEEK_SET));
}

std::error_code sync(std::FILE* file) { return error_of(::fsync(::fileno(file))); }

std::error_code make_folder(const fs::path& path, Whose whose) {
  return error_of(::mkdir(path.c_str(), of_all(whose, 0777, 0700)));
}

std::error_code link(const fs::path& from, const fs::path& to) {
  return error_of(::linkat(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), 0));
}

std::error_code rename_to_new(const fs::path& from, const fs::path& to) {
  return error_of(::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE));
}

std::error_code exchange(const fs::path& one, const fs::path& other) {
  return error_of(::renameat2(AT_FDCWD, one.c_str(), AT_FDCWD, other.c_str(), RENAME_EXCHANGE));
}

void remove_file(const fs::path& path) { ::unlink(path.c_str()); }
void remove_folder(const fs::path& path) { ::rmdir(path.c_str()); }

bool lock(const Handle& folder) { return ::flock(folder.number(), LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK; }

std::error_code try_new_file_in(const fs::path& folder, std::size_t bytes) {
  // For root, access() grants what the file system refuses. So this creates a file, without a name if possible, since
  // the process may be killed at any moment.
  std::error_code error;
  Handle file = opened(folder, O_TMPFILE | O_WRONLY, error, 0600);
  if (!file.good()) {
    std::string probe = (folder / ".vsplat-XXXXXX").string();
    file = Handle(::mkstemp(probe.data()));
    if (!file.good()) return last_error();
    ::unlink(probe.c_str());
  }
  if (bytes == 0) return {};
  const int problem = ::posix_fallocate(file.number(), 0, static_cast<off_t>(bytes));
  return {problem, std::generic_category()};
}

std::error_code try_device(const fs::path& file) {
  std::error_code error;
  opened(file, O_RDWR | O_NONBLOCK | O_NOCTTY, error);
  return error;
}

std::string group_of(const fs::path& file) {
  struct stat found {};
  if (::stat(file.c_str(), &found) != 0) return "";
  const group* who = ::getgrgid(found.st_gid);
  return who ? text_of(who->gr_name) : "";
}

// ----------------------------------------------------------------------------------------------------------------
// this process and where it runs

int process_id() { return ::getpid(); }

bool error_output_is_terminal() { return ::isatty(STDERR_FILENO) != 0; }

fs::path program_path(std::error_code& error) { return fs::read_symlink("/proc/self/exe", error); }

void set_variable(const char* name, const char* value) { ::setenv(name, value, 0); }

void unset_if_empty(const char* name) {
  if (const char* value = std::getenv(name); value && !*value) ::unsetenv(name);
}

namespace {

std::atomic<bool> stops_end = false;

bool is_ignored(int signal) {
  struct sigaction now {};
  return ::sigaction(signal, nullptr, &now) == 0 && now.sa_handler == SIG_IGN;
}

// Ends the process as an uncaught signal does.
void end_by(int signal) {
  std::signal(signal, SIG_DFL);
  sigset_t one;
  ::sigemptyset(&one);
  ::sigaddset(&one, signal);
  ::pthread_sigmask(SIG_UNBLOCK, &one, nullptr);
  std::raise(signal);
}

void wait_for_stops(sigset_t stops, bool hang_up_ignored, void (*handler)(int)) {
  for (bool asked = false;;) {
    int signal = 0;
    if (::sigwait(&stops, &signal) != 0 || (signal == SIGHUP && hang_up_ignored)) continue;
    if (asked || stops_end) end_by(signal);
    handler(signal);
    asked = true;
  }
}

}  // namespace

// All threads block these signals; only one thread waits for them. LLVM, which PoCL compiles with, replaces our
// handlers and SIG_IGN while it compiles, and its handlers remove the files that it is writing. Programs that a driver
// starts (a linker, for instance) inherit the mask, so a terminal's Ctrl-C does not end them.
void catch_stops(void (*handler)(int)) {
  static const bool hang_up_ignored = is_ignored(SIGHUP);  // set by nohup
  static pid_t waits = 0;                                  // the process that has the waiting thread
  stops_end = false;
  if (std::exchange(waits, ::getpid()) == ::getpid()) return;
  sigset_t stops;
  ::sigemptyset(&stops);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::sigaddset(&stops, signal);
  ::pthread_sigmask(SIG_BLOCK, &stops, nullptr);
  std::thread(wait_for_stops, stops, hang_up_ignored, handler).detach();
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
}

void let_stops_end() { stops_end = true; }

namespace {

std::array<char, 8192> last_words{};
std::atomic<std::size_t> last_words_size = 0;

void on_fault(int signal) {
  // (A failed write is ignored.)
  [[maybe_unused]] const ssize_t written = ::write(STDERR_FILENO, last_words.data(), last_words_size);
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

}  // namespace

void tell_of_faults(const std::string& text) {
  last_words_size = 0;
  const std::size_t size = std::min(text.size(), last_words.size());
  std::copy_n(text.begin(), size, last_words.begin());
  last_words_size = size;
  for (const int fault : {SIGSEGV, SIGBUS, SIGABRT, SIGILL, SIGFPE}) {
    struct sigaction now {};
    if (::sigaction(fault, nullptr, &now) == 0 && now.sa_handler == SIG_DFL) std::signal(fault, on_fault);
  }
}

User this_user() {
  const passwd* entry = ::getpwuid(::geteuid());
  return entry ? User{text_of(entry->pw_name), text_of(entry->pw_dir)} : User();
}

std::string host_name() {
  char out[256] = {};
  return ::gethostname(out, sizeof out - 1) == 0 ? out : "";
}

Host this_host() {
  utsname names{};
  ::uname(&names);
  Host out;
  out.kernel = std::string(names.sysname) + " " + names.release;
  out.machine = names.machine;
  out.libc = std::string("glibc ") + ::gnu_get_libc_version();
  out.processors = ::sysconf(_SC_NPROCESSORS_ONLN);
  out.memory =
      static_cast<std::uint64_t>(::sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return out;
}

namespace {

std::string first_line(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

// "" and "max" count as no number.
std::size_t number_in(const std::string& path) {
  std::istringstream in(first_line(path));
  std::uint64_t value = 0;
  return in >> value ? static_cast<std::size_t>(value) : kUnknownMemory;
}

std::size_t available_memory() {
  std::ifstream file("/proc/meminfo");
  for (std::string line; std::getline(file, line);)
    if (line.rfind("MemAvailable:", 0) == 0) {
      std::istringstream in(line.substr(13));
      std::uint64_t kib = 0;
      if (in >> kib) return static_cast<std::size_t>(kib) << 10;
    }
  return kUnknownMemory;
}

std::size_t less(std::size_t most, std::size_t used) {
  return most == kUnknownMemory || used == kUnknownMemory ? kUnknownMemory : most - std::min(most, used);
}

// The smallest amount of memory that this process's control group (version 2) and its parents leave.
std::size_t left_by_control_groups() {
  constexpr char prefix[] = "0::";
  std::string group;
  std::ifstream file("/proc/self/cgroup");
  for (std::string line; std::getline(file, line);)
    if (line.rfind(prefix, 0) == 0) group = line.substr(sizeof prefix - 1);
  std::size_t left = kUnknownMemory;
  while (!group.empty()) {
    const std::string folder = "/sys/fs/cgroup" + group + "/";
    left = std::min(left, less(number_in(folder + "memory.max"), number_in(folder + "memory.current")));
    if (group == "/") break;
    group.resize(group.rfind('/'));
    if (group.empty()) group = "/";
  }
  return left;
}

std::size_t left_of_address_space() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kUnknownMemory;
  const std::size_t pages = number_in("/proc/self/statm");
  return pages == kUnknownMemory ? kUnknownMemory
                                 : less(limit.rlim_cur, pages * static_cast<std::size_t>(::sysconf(_SC_PAGESIZE)));
}

}  // namespace

std::size_t free_memory() { return std::min({available_memory(), left_by_control_groups(), left_of_address_space()}); }

// ----------------------------------------------------------------------------------------------------------------
// libraries

void* load_library(const std::string& path, Symbols symbols, std::string& why) {
  void* out = ::dlopen(path.c_str(), RTLD_NOW | (symbols == Symbols::shared ? RTLD_GLOBAL : RTLD_LOCAL));
  why = out ? "" : text_of(::dlerror());
  return out;
}

void* symbol(void* library, const char* name) { return ::dlsym(library, name); }

std::string library_of(const void* address) {
  Dl_info found{};
  return ::dladdr(address, &found) != 0 ? text_of(found.dli_fname) : "";
}

}  // namespace vsplat::sys
