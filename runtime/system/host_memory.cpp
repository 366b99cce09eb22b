#include "runtime/system/host_memory.h"

#include <algorithm>
#include <mutex>

#include "runtime/fail.h"
#include "runtime/option.h"
#include "runtime/system/system.h"

namespace vsplat {
namespace {

std::mutex lock;
std::size_t reserved = 0, given_limit = 0, default_limit = 0;  // 0: not set, not yet needed

std::size_t limit_now() {  // The caller holds `lock`.
  if (given_limit) return given_limit;
  if (default_limit == 0) {
    const std::size_t free = free_host_memory();
    default_limit = free == 0 ? sys::kUnknownMemory : free / 4 * 3;
  }
  return default_limit;
}

double gib(double bytes) { return bytes / (1u << 30); }

}  // namespace

std::size_t free_host_memory() {
  const std::size_t free = sys::free_memory();
  return free == sys::kUnknownMemory ? 0 : free;
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
         "({})",
         what, gib(bytes), gib(static_cast<double>(left)), gib(static_cast<double>(limit)), Option::max_host_memory);
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
