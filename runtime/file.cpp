#include "runtime/file.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "runtime/fail.h"
#include "runtime/output_file.h"

namespace vsplat {
namespace {

struct Closer {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Closer>;

}  // namespace

std::vector<unsigned char> read_file(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) fail(Status::file, "{}: is a folder, a file is expected", path);
  const File file(std::fopen(path.c_str(), "rb"));
  if (!file) fail(Status::file, "{}: cannot be opened: {}", path, std::strerror(errno));
  std::vector<unsigned char> out;
  const auto expected = std::filesystem::file_size(path, ignored);
  if (!ignored) out.reserve(static_cast<std::size_t>(expected) + 1);
  unsigned char block[1 << 16];
  while (const std::size_t n = std::fread(block, 1, sizeof block, file.get())) out.insert(out.end(), block, block + n);
  if (std::ferror(file.get())) fail(Status::file, "{}: cannot be read: {}", path, std::strerror(errno));
  return out;
}

void write_file(const std::string& path, const void* data, std::size_t size) {
  OutputFile file(path);
  file.write(data, size);
  file.commit();
}

}  // namespace vsplat
