// An object that the operating system holds open for this process: a file, a folder, one end of a channel.
#pragma once
#include <utility>

namespace vsplat::sys {

// Owns such an object and closes it on destruction; may be empty.
class Handle {
 public:
  // The system's number of the object; below 0: empty.
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
