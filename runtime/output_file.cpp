#include "runtime/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>

#include "runtime/fail.h"
#include "runtime/file_rules.h"
#include "runtime/host_span.h"

namespace vsplat {

OutputFile::OutputFile(const std::string& path, unsigned mode) : path_(path) {
  static std::atomic<unsigned> serial{0};
  int descriptor = -1;
  // One of that name may be left of a process that was killed: in containers numbers of processes are the same again.
  for (int attempt = 0; attempt < 10000; ++attempt) {
    temporary_ = fmt::format("{}.{}-{}.tmp", path, ::getpid(), serial++);
    descriptor = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
    if (descriptor >= 0 || errno != EEXIST) break;
  }
  if (descriptor < 0) fail(Status::file, "{}: cannot be created as {}: {}", path, temporary_, std::strerror(errno));
  file_ = ::fdopen(descriptor, "wb");
  if (file_ == nullptr) {
    ::close(descriptor);
    ::unlink(temporary_.c_str());
    failed("be opened");
  }
}

OutputFile::~OutputFile() {
  if (file_ == nullptr) return;
  std::fclose(file_);
  ::unlink(temporary_.c_str());
}

void OutputFile::write(const void* data, std::size_t bytes) {
  const HostSpan span(HostKind::file, "write", path_);
  if (bytes != 0 && std::fwrite(data, 1, bytes, file_) != bytes) failed("be written");
}

void OutputFile::commit() {
  const HostSpan span(HostKind::file, "bring to the disk", path_);
  if (std::fflush(file_) != 0 || ::fsync(::fileno(file_)) != 0) failed("be written");
  const bool created = rename_to_new(temporary_, path_);
  if (!created && !may_replace(path_))
    fail(Status::file, "{}: exists, made by another process meanwhile; it is kept", path_);
  if (!created && ::rename(temporary_.c_str(), path_.c_str()) != 0) failed("be put in place");
  tell_written(path_, created);
  std::fclose(file_);
  file_ = nullptr;
}

void OutputFile::failed(const char* what) const {
  fail(Status::file, "{}: cannot {}: {}", path_, what, std::strerror(errno));
}

}  // namespace vsplat
