// One budget for the memory of the host, of the whole process: whoever is about to hold much of it on a stranger's word
// (a picture's header) reserves it first. Thread-safe.
#pragma once
#include <cstddef>
#include <string>

namespace vsplat {

// Bytes that this process could take now: what the system has available, or less where the control groups that it is in
// or a limit of its address space (`ulimit -v`) leave less. 0 where the system does not tell.
std::size_t free_host_memory();

// What may be reserved in all. Until it is set: three quarters of what was free when it was first asked for; without a
// bound where the system does not tell.
std::size_t host_memory_limit();
// Bytes; 0: as before it was ever set. What is reserved stays so.
void set_host_memory_limit(std::size_t bytes);
// Bytes that are reserved now.
std::size_t reserved_host_memory();

// Bytes of the budget, given back at the end.
class HostMemory {
 public:
  HostMemory() = default;
  // `what` as an error's sentence begins: "a.png: decoding its 4096 x 4096 pixels". Error(memory) with what it takes
  // and what is left.
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
