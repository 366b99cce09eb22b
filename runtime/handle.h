// What the operating system has open for this process: a file, a folder, one end of a channel.
#pragma once
#include <utility>

namespace vsplat::sys {

// Closed at its end; or nothing.
class Handle {
 public:
  // The system's own number for it, below 0 for nothing.
  explicit Handle(int number = -1) : number_(number) {}
  ~Handle();
  Handle(Handle&& other) noexcept : number_(other.release()) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  int number() const { return number_; }
  int release() { return std::exchange(number_, -1); }
  bool good() const { return number_ >= 0; }

 private:
  int number_;
};

}  // namespace vsplat::sys
