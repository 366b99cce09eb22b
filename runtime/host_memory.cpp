#include "runtime/host_memory.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <limits>
#include <mutex>
#include <sstream>

#include "runtime/fail.h"

namespace vsplat {
namespace {

constexpr std::size_t unknown = std::numeric_limits<std::size_t>::max();

std::mutex lock;
std::size_t reserved = 0, given_limit = 0, default_limit = 0;  // 0: not set, not asked for yet

std::string first_line(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

// "" and "max" are no number.
std::size_t number_in(const std::string& path) {
  std::istringstream in(first_line(path));
  std::uint64_t value = 0;
  return in >> value ? static_cast<std::size_t>(value) : unknown;
}

std::size_t available_memory() {
  std::ifstream file("/proc/meminfo");
  for (std::string line; std::getline(file, line);)
    if (line.rfind("MemAvailable:", 0) == 0) {
      std::istringstream in(line.substr(13));
      std::uint64_t kib = 0;
      if (in >> kib) return static_cast<std::size_t>(kib) << 10;
    }
  return unknown;
}

std::size_t less(std::size_t most, std::size_t used) {
  return most == unknown || used == unknown ? unknown : most - std::min(most, used);
}

// The least that this process's control group (version 2) and those above it leave.
std::size_t left_by_control_groups() {
  constexpr char prefix[] = "0::";
  std::string group;
  std::ifstream file("/proc/self/cgroup");
  for (std::string line; std::getline(file, line);)
    if (line.rfind(prefix, 0) == 0) group = line.substr(sizeof prefix - 1);
  std::size_t left = unknown;
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
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return unknown;
  const std::size_t pages = number_in("/proc/self/statm");
  return pages == unknown ? unknown : less(limit.rlim_cur, pages * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)));
}

std::size_t limit_now() {  // `lock` is held
  if (given_limit) return given_limit;
  if (default_limit == 0) {
    const std::size_t free = free_host_memory();
    default_limit = free == 0 ? unknown : free / 4 * 3;
  }
  return default_limit;
}

double gib(double bytes) { return bytes / (1u << 30); }

}  // namespace

std::size_t free_host_memory() {
  const std::size_t least = std::min({available_memory(), left_by_control_groups(), left_of_address_space()});
  return least == unknown ? 0 : least;
}

std::size_t host_memory_limit() {
  const std::lock_guard hold(lock);
  return limit_now();
}

void set_host_memory_limit(std::size_t bytes) {
  const std::lock_guard hold(lock);
  given_limit = bytes;
  if (bytes == 0) default_limit = 0;
}

std::size_t reserved_host_memory() {
  const std::lock_guard hold(lock);
  return reserved;
}

HostMemory::HostMemory(const std::string& what, double bytes) {
  const std::lock_guard hold(lock);
  const std::size_t limit = limit_now(), left = limit - std::min(limit, reserved);
  if (!(bytes <= static_cast<double>(left)))
    fail(Status::memory,
         "{} takes {:.4g} GiB of the host's memory; {:.4g} GiB are left of the {:.4g} GiB that may be used "
         "(vsplat_set_host_memory)",
         what, gib(bytes), gib(static_cast<double>(left)), gib(static_cast<double>(limit)));
  bytes_ = static_cast<std::size_t>(bytes);
  reserved += bytes_;
}

HostMemory& HostMemory::operator=(HostMemory&& other) noexcept {
  std::swap(bytes_, other.bytes_);
  return *this;
}

HostMemory::~HostMemory() {
  if (bytes_ == 0) return;
  const std::lock_guard hold(lock);
  reserved -= bytes_;
}

}  // namespace vsplat
