#include "model/api/result_memory.h"

#include <algorithm>
#include <cstdint>
#include <tuple>

#include "runtime/fail.h"

namespace vsplat::api {

void Outputs::add(const void* at, std::size_t bytes, const std::string& name) {
  const auto begin = reinterpret_cast<std::uintptr_t>(at);
  if (at && bytes > 0) all_.push_back({0, begin, begin + bytes, name});
}

void Outputs::add(void* buffer, std::size_t begin, std::size_t bytes, const std::string& name) {
  if (buffer && bytes > 0) all_.push_back({reinterpret_cast<std::uintptr_t>(buffer), begin, begin + bytes, name});
}

void Outputs::refuse_shared() {
  const auto place = [](const Range& r) { return std::tie(r.space, r.begin); };
  std::sort(all_.begin(), all_.end(), [&](const Range& a, const Range& b) { return place(a) < place(b); });
  for (std::size_t i = 1; i < all_.size(); ++i) {
    const Range &a = all_[i - 1], &b = all_[i];
    if (a.space == b.space && b.begin < a.end)
      fail(Status::usage, "{} and {} share memory: each output needs memory of its own", a.name, b.name);
  }
}

void Outputs::refuse_input(void* buffer, std::size_t begin, std::size_t bytes, const char* name) const {
  const auto space = reinterpret_cast<std::uintptr_t>(buffer);
  for (const Range& r : all_)
    if (r.space == space && begin < r.end && r.begin < begin + bytes)
      fail(Status::usage, "{} and {} share memory: what is read and what is written need memory of their own", name,
           r.name);
}

}  // namespace vsplat::api
