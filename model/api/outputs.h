// The memory that a call writes what it makes to.
#pragma once
#include <cstddef>
#include <string>
#include <vector>

namespace vsplat::api {

// No two of a call's outputs may share memory: the one that is written last would be all that is left.
class Outputs {
 public:
  // Of the caller's memory; nothing where `at` is null.
  void add(const void* at, std::size_t bytes, const std::string& name);
  // Of a buffer of a device, from its byte `begin` on.
  void add(void* buffer, std::size_t begin, std::size_t bytes, const std::string& name);
  bool empty() const { return all_.empty(); }

  // Error(usage), naming both.
  void refuse_shared();
  // An input that is read while the outputs are written, and so may be none of them.
  void refuse_input(void* buffer, std::size_t begin, std::size_t bytes, const char* name) const;

 private:
  struct Range {
    std::size_t space, begin, end;  // `space` is a buffer, or 0: the host's memory
    std::string name;
  };
  std::vector<Range> all_;
};

}  // namespace vsplat::api
