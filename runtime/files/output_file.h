// A file that appears whole or not at all: written under a temporary name beside its own, renamed by commit(). Whatever
// ends before that (an exception, a full disk) leaves the old file, or none, and removes the temporary one.
#pragma once
#include <cstddef>
#include <cstdio>
#include <string>
#include <system_error>

#include "runtime/system/system.h"

namespace vsplat {

// For files of the cache: its readers reject files that others may write to, which a umask of 002 would allow.
constexpr sys::Whose kOwnersAlone = sys::Whose::owner;

// While this object lives, the file that this thread writes goes to memory instead: no file is created, and no file
// rule is asked or called.
class OutputToMemory {
 public:
  OutputToMemory();
  ~OutputToMemory();
  OutputToMemory(const OutputToMemory&) = delete;
  OutputToMemory& operator=(const OutputToMemory&) = delete;
  // The file's content, after its commit().
  const std::string& bytes() const { return bytes_; }

 private:
  friend class OutputFile;
  std::string bytes_;
  bool taken_ = false;
};

class OutputFile {
 public:
  // Error(file) if the folder cannot be written.
  explicit OutputFile(const std::string& path, sys::Whose whose = sys::Whose::everybody);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  void write(const void* data, std::size_t bytes);
  void write(const std::string& text) { write(text.data(), text.size()); }
  // Flushes to disk, then renames. Error(file) if a file is there that may not be replaced (file_rules.h).
  void commit();

 private:
  [[noreturn]] void failed(const char* what, const std::error_code& why) const;

  std::string path_, temporary_;
  std::FILE* file_ = nullptr;
  OutputToMemory* memory_ = nullptr;  // used instead of a file
};

}  // namespace vsplat
