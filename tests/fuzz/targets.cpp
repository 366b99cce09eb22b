#include "tests/fuzz/targets.h"

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <stdexcept>

namespace vsplat::fuzz {

MemoryFile::MemoryFile() : descriptor_(::memfd_create("input", MFD_CLOEXEC)) {
  if (descriptor_ < 0) throw std::runtime_error("no file in memory");
  path_ = fmt::format("/proc/{}/fd/{}", ::getpid(), descriptor_);
}

MemoryFile::~MemoryFile() { ::close(descriptor_); }

void MemoryFile::fill(std::string_view bytes) {
  if (::ftruncate(descriptor_, 0) != 0 ||
      ::pwrite(descriptor_, bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw std::runtime_error("the file in memory cannot be written");
}

void hold(bool condition, const char* what) {
  if (!condition) throw std::logic_error(std::string("does not hold: ") + what);
}

void hold_message(const Error& error, const std::string& path) {
  const std::string text = error.what();
  hold(error.status() == Status::file || error.status() == Status::format || error.status() == Status::input,
       "an error of the file, its format or what it says");
  hold(text.find(path) != std::string::npos, "the message names the file");
  hold(text.size() < 1500, "the message is short");
  hold(std::none_of(text.begin(), text.end(), [](char c) { return (c >= 0 && c < ' ') || c == '\x7f'; }),
       "the message has no control characters");
}

}  // namespace vsplat::fuzz
