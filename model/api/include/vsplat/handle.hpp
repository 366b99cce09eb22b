// Errors, strings and handles for C++. Part of vsplat.hpp, which includes this file.
#ifndef VSPLAT_HANDLE_HPP
#define VSPLAT_HANDLE_HPP

#include <vsplat/vsplat.h>

#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace vsplat {
inline namespace cxx {

class Error : public std::runtime_error {
 public:
  Error(vsplat_status status, const char* message) : std::runtime_error(message), status_(status) {}
  vsplat_status status() const noexcept { return status_; }

 private:
  vsplat_status status_;
};

inline void check(vsplat_status status) {
  if (status != VSPLAT_OK) throw Error(status, vsplat_last_error());
}

// Copies and frees a string that a call returned.
inline std::string text(char* from) {
  std::string out(from);
  vsplat_text_free(from);
  return out;
}
// Copies and frees bytes that a call returned.
inline std::vector<unsigned char> bytes(char* from, std::size_t size) {
  std::vector<unsigned char> out(from, from + size);
  vsplat_text_free(from);
  return out;
}
// The lines of a text, each ended by a line feed.
inline std::vector<std::string> lines(const std::string& text) {
  std::vector<std::string> out(1);
  for (const char c : text) {
    if (c == '\n')
      out.emplace_back();
    else
      out.back() += c;
  }
  out.pop_back();
  return out;
}

// A counted reference; get() for the C functions.
template <class T, void (*Retain)(T), void (*Release)(T)>
class Handle {
 public:
  Handle() = default;
  explicit Handle(T owned) : handle_(owned) {}
  Handle(const Handle& other) : handle_(other.handle_) { Retain(handle_); }
  Handle(Handle&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  Handle& operator=(Handle other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Handle() { Release(handle_); }

  T get() const { return handle_; }
  explicit operator bool() const { return handle_ != nullptr; }

 private:
  T handle_ = nullptr;
};

}  // namespace cxx
}  // namespace vsplat

#endif
