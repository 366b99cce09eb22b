#include "tests/fuzz/targets.h"

#include <fmt/format.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>

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
  // Commands to copy stand in lines of their own.
  for (std::size_t i = 0; i < text.size(); ++i) {
    const std::string_view rest = std::string_view(text).substr(i);
    hold((static_cast<unsigned char>(text[i]) >= ' ' && text[i] != '\x7f') || rest.starts_with("\n  vsplat poses ") ||
             rest.starts_with("\nThen give "),
         "the message has no control characters");
  }
}

}  // namespace vsplat::fuzz
