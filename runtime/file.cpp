#include "runtime/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "runtime/fail.h"
#include "runtime/host_span.h"
#include "runtime/output_file.h"

namespace vsplat {

std::unique_ptr<std::FILE, FileCloser> open_regular(const std::string& path) {
  // Of a pipe this does not wait for a writer; of a regular file it means nothing.
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (descriptor < 0) fail(Status::file, "{}: cannot be opened: {}", path, std::strerror(errno));
  struct stat found {};
  const bool known = ::fstat(descriptor, &found) == 0;
  std::unique_ptr<std::FILE, FileCloser> out;
  if (known && S_ISREG(found.st_mode)) out.reset(::fdopen(descriptor, "rb"));
  if (!out) ::close(descriptor);
  if (known && S_ISDIR(found.st_mode)) fail(Status::file, "{}: is a folder, a file is expected", path);
  if (known && !S_ISREG(found.st_mode)) fail(Status::file, "{}: is no regular file; one is expected", path);
  if (!out) fail(Status::file, "{}: cannot be opened: {}", path, std::strerror(errno));
  return out;
}

InputFile::InputFile(const std::string& path) : path_(path), file_(open_regular(path)) {}

void InputFile::read(std::size_t most, std::vector<unsigned char>& out) {
  const HostSpan span(HostKind::file, "read", path_);
  unsigned char block[1 << 16];
  while (most > 0) {
    const std::size_t n = std::fread(block, 1, std::min(most, sizeof block), file_.get());
    if (n == 0) break;
    out.insert(out.end(), block, block + n);
    most -= n;
  }
  if (std::ferror(file_.get())) fail(Status::file, "{}: cannot be read: {}", path_, std::strerror(errno));
  at_end_ = most > 0;
}

std::vector<unsigned char> read_file(const std::string& path) try {
  InputFile file(path);
  std::vector<unsigned char> out;
  std::error_code ignored;
  const auto expected = std::filesystem::file_size(path, ignored);
  if (!ignored) out.reserve(static_cast<std::size_t>(expected) + 1);
  while (!file.at_end()) file.read(std::size_t{1} << 30, out);
  return out;
} catch (const std::bad_alloc&) {
  fail(Status::memory, "{}: not enough host memory to read it", path);
}

void write_file(const std::string& path, const void* data, std::size_t size) {
  OutputFile file(path);
  file.write(data, size);
  file.commit();
}

}  // namespace vsplat
