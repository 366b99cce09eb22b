#include "model/io/reader/program/confine.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstddef>
#include <vector>

#include "model/io/reader/sanitized.h"
#if __has_include(<linux/landlock.h>)
#include <linux/landlock.h>
#endif

namespace vsplat::read {
namespace {

#if defined(__x86_64__)
constexpr std::uint32_t architecture = AUDIT_ARCH_X86_64;
#elif defined(__aarch64__)
constexpr std::uint32_t architecture = AUDIT_ARCH_AARCH64;
#else
constexpr std::uint32_t architecture = 0;  // unknown: no filter
#endif

// System calls for reading open files, answering, allocating memory and exiting. C libraries differ in which of them
// they use.
const long allowed[] = {
    SYS_read,
    SYS_readv,
    SYS_pread64,
    SYS_write,
    SYS_writev,
    SYS_close,
    SYS_lseek,
    SYS_fstat,
    SYS_newfstatat,
    SYS_ppoll,
    SYS_recvfrom,
    SYS_recvmsg,
    SYS_sendto,
    SYS_sendmsg,
    SYS_munmap,
    SYS_mremap,
    SYS_madvise,
    SYS_brk,
    SYS_futex,
    SYS_rt_sigreturn,
    SYS_rt_sigaction,
    SYS_rt_sigprocmask,
    SYS_sigaltstack,
    SYS_exit,
    SYS_exit_group,
    SYS_clock_gettime,
    SYS_clock_getres,
    SYS_gettimeofday,
    SYS_getrandom,
    SYS_getpid,
    SYS_gettid,
    SYS_getcwd,
    SYS_sched_yield,
    SYS_sched_getaffinity,
    SYS_setitimer,
    SYS_getrusage,
    SYS_uname,
    SYS_sysinfo,
    SYS_restart_syscall,
#ifdef SYS_poll
    SYS_poll,
#endif
#ifdef SYS_alarm
    SYS_alarm,
#endif
#ifdef SYS_time
    SYS_time,
#endif
};

// The sanitizers test with a pipe whether memory is readable.
const long pipes[] = {
    SYS_pipe2,
#ifdef SYS_pipe
    SYS_pipe,
#endif
};

using Filter = std::vector<sock_filter>;

void load(Filter& filter, std::size_t offset) {
  filter.push_back(BPF_STMT(BPF_LD | BPF_W | BPF_ABS, static_cast<std::uint32_t>(offset)));
}
void give(Filter& filter, std::uint32_t what) { filter.push_back(BPF_STMT(BPF_RET | BPF_K, what)); }
constexpr std::uint32_t no = SECCOMP_RET_ERRNO | EPERM;

std::size_t low_half(int argument) { return offsetof(seccomp_data, args) + 8 * static_cast<std::size_t>(argument); }

void allow(Filter& filter, long call) {
  filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 1));
  give(filter, SECCOMP_RET_ALLOW);
}

// Allows `call` if the lower half of the argument equals `value`.
void allow_with(Filter& filter, long call, int argument, std::uint32_t value) {
  filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 4));
  load(filter, low_half(argument));
  filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, 1));
  give(filter, SECCOMP_RET_ALLOW);
  give(filter, no);
}

// Allows `call` if the lower half of the argument has none of `bits` set.
void allow_without(Filter& filter, long call, int argument, std::uint32_t bits) {
  filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, static_cast<std::uint32_t>(call), 0, 4));
  load(filter, low_half(argument));
  filter.push_back(BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, bits, 1, 0));
  give(filter, SECCOMP_RET_ALLOW);
  give(filter, no);
}

bool filter_calls() {
  if (architecture == 0) return false;
  Filter filter;
  load(filter, offsetof(seccomp_data, arch));
  filter.push_back(BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, architecture, 1, 0));
  give(filter, no);
  load(filter, offsetof(seccomp_data, nr));
  for (const long call : allowed) allow(filter, call);
  if (sanitized)
    for (const long call : pipes) allow(filter, call);
  allow_without(filter, SYS_mmap, 2, PROT_EXEC);
  allow_without(filter, SYS_mprotect, 2, PROT_EXEC);
  allow_with(filter, SYS_prlimit64, 0, 0);  // limits of this process only
  allow_with(filter, SYS_tgkill, 0, static_cast<std::uint32_t>(::getpid()));
  give(filter, no);
  const sock_fprog program{static_cast<unsigned short>(filter.size()), filter.data()};
  return ::prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

// Applies a Landlock rule set that denies everything that version 1 covers.
bool close_file_system() {
#ifdef LANDLOCK_ACCESS_FS_MAKE_SYM
  landlock_ruleset_attr everything{};
  everything.handled_access_fs = (LANDLOCK_ACCESS_FS_MAKE_SYM << 1) - 1;
  const long rules = ::syscall(SYS_landlock_create_ruleset, &everything, sizeof everything, 0);
  if (rules < 0) return false;
  const bool done = ::syscall(SYS_landlock_restrict_self, rules, 0) == 0;
  ::close(static_cast<int>(rules));
  return done;
#else
  return false;
#endif
}

bool limit(decltype(RLIMIT_CORE) what, rlim_t most) {
  rlimit now{};
  if (::getrlimit(what, &now) != 0) return false;
  if (now.rlim_max == RLIM_INFINITY || now.rlim_max > most) now.rlim_max = most;
  now.rlim_cur = now.rlim_max;
  return ::setrlimit(what, &now) == 0;
}

}  // namespace

void limit_memory(std::uint64_t bytes) {
  rlimit now{};
  if (sanitized || ::getrlimit(RLIMIT_AS, &now) != 0) return;
  now.rlim_cur = now.rlim_max == RLIM_INFINITY || now.rlim_max > bytes ? static_cast<rlim_t>(bytes) : now.rlim_max;
  ::setrlimit(RLIMIT_AS, &now);
}

void limit_time(unsigned seconds) { ::alarm(seconds); }
void more_time(unsigned seconds) { ::alarm(::alarm(0) + seconds); }

std::uint32_t confine(std::uint64_t memory, bool dies_with_parent) {
  std::uint32_t out = 0;
  if (dies_with_parent) ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  limit_memory(memory);
  const bool limited = limit(RLIMIT_CORE, 0) && limit(RLIMIT_FSIZE, 0) && limit(RLIMIT_NOFILE, 64) &&
                       limit(RLIMIT_NPROC, 0) && (!dies_with_parent || limit(RLIMIT_CPU, 600));
  if (limited) out |= confined_by_limits;
  const bool fixed = ::prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0;
  if (fixed && close_file_system()) out |= confined_by_landlock;
  if (fixed && filter_calls()) out |= confined_by_seccomp;
  return out;
}

}  // namespace vsplat::read
