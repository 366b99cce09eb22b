// A budget for host memory, for the whole process: code that allocates much of it on the word of untrusted data (a
// picture's header) reserves it first. Thread-safe.
#pragma once
#include <cstddef>
#include <string>

namespace vsplat {

// Bytes that this process could allocate now: the memory that the system has available, or less if its control groups
// or its address space limit (`ulimit -v`) leave less. 0 if the system does not report it.
std::size_t free_host_memory();

// The limit of all reservations. Until it is set: three quarters of the memory that was free at the first query;
// unlimited if the system does not report it.
std::size_t host_memory_limit();
// Sets the limit in bytes; 0 restores the default. Existing reservations stay.
void set_host_memory_limit(std::size_t bytes);
// Bytes reserved now.
std::size_t reserved_host_memory();

// A reservation from the budget, released on destruction.
class HostMemory {
 public:
  HostMemory() = default;
  // `what` begins the error's sentence: "a.png: decoding its 4096 x 4096 pixels". Error(memory) states the bytes needed
  // and the bytes left.
  HostMemory(const std::string& what, double bytes);
  HostMemory(HostMemory&& other) noexcept : bytes_(other.bytes_) { other.bytes_ = 0; }
  HostMemory& operator=(HostMemory&& other) noexcept;
  HostMemory(const HostMemory&) = delete;
  HostMemory& operator=(const HostMemory&) = delete;
  ~HostMemory();

  std::size_t bytes() const { return bytes_; }

 private:
  std::size_t bytes_ = 0;
};

}  // namespace vsplat
