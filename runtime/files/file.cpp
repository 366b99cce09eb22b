#include "runtime/files/file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "runtime/fail.h"
#include "runtime/files/output_file.h"
#include "runtime/host_span.h"
#include "runtime/system/system.h"

namespace vsplat {

std::unique_ptr<std::FILE, FileCloser> open_regular(const std::string& path) {
  std::error_code problem;
  sys::Handle opened = sys::open_to_read(path, problem);
  if (problem) fail(Status::file, "{}: cannot be opened: {}", path, problem.message());
  const std::optional<sys::FileFacts> found = sys::facts_of(opened, problem);
  if (found && found->is_folder()) fail(Status::file, "{}: is a folder, a file is expected", path);
  if (found && !found->is_file()) fail(Status::file, "{}: is no regular file; one is expected", path);
  std::unique_ptr<std::FILE, FileCloser> out;
  if (found) out.reset(sys::stream(std::move(opened), "rb", problem));
  if (!out) fail(Status::file, "{}: cannot be opened: {}", path, problem.message());
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
