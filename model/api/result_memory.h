// Checks of the memory that a call writes its results to.
#pragma once
#include <cstddef>
#include <string>
#include <vector>

namespace vsplat::api {

// Refuses outputs of one call that share memory: only the one written last would remain.
class Outputs {
 public:
  // Adds memory of the caller; nothing if `at` is null.
  void add(const void* at, std::size_t bytes, const std::string& name);
  // Adds a device buffer, from its byte `begin` on.
  void add(void* buffer, std::size_t begin, std::size_t bytes, const std::string& name);
  bool empty() const { return all_.empty(); }

  // Error(usage) naming two outputs that share memory.
  void refuse_shared();
  // Refuses an input that shares memory with an output, since it is read while the outputs are written.
  void refuse_input(void* buffer, std::size_t begin, std::size_t bytes, const char* name) const;

 private:
  struct Range {
    std::size_t space, begin, end;  // `space` is a buffer, or 0 for host memory
    std::string name;
  };
  std::vector<Range> all_;
};

}  // namespace vsplat::api
