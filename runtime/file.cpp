#include "runtime/file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "runtime/fail.h"
#include "runtime/output_file.h"

namespace vsplat {

InputFile::InputFile(const std::string& path) : path_(path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) fail(Status::file, "{}: is a folder, a file is expected", path);
  file_.reset(std::fopen(path.c_str(), "rb"));
  if (!file_) fail(Status::file, "{}: cannot be opened: {}", path, std::strerror(errno));
}

void InputFile::read(std::size_t most, std::vector<unsigned char>& out) {
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

std::vector<unsigned char> read_file(const std::string& path) {
  InputFile file(path);
  std::vector<unsigned char> out;
  std::error_code ignored;
  const auto expected = std::filesystem::file_size(path, ignored);
  if (!ignored) out.reserve(static_cast<std::size_t>(expected) + 1);
  while (!file.at_end()) file.read(std::size_t{1} << 30, out);
  return out;
}

void write_file(const std::string& path, const void* data, std::size_t size) {
  OutputFile file(path);
  file.write(data, size);
  file.commit();
}

}  // namespace vsplat
