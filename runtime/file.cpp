#include "runtime/file.h"

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "runtime/error.h"

namespace vsplat {
namespace {

struct Closer {
  void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Closer>;

// Beside the target, so that the rename stays within one file system; unique among processes and threads.
std::string temporary_name(const std::string& path) {
  static std::atomic<unsigned> counter{0};
  return fmt::format("{}.{}-{}.tmp", path, static_cast<long>(getpid()), counter++);
}

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
  const std::string temporary = temporary_name(path);
  File file(std::fopen(temporary.c_str(), "wb"));
  if (!file) fail(Status::file, "{}: cannot be written: {}", path, std::strerror(errno));
  bool good = size == 0 || std::fwrite(data, 1, size, file.get()) == size;
  good = good && std::fflush(file.get()) == 0;
  int problem = errno;
  if (std::fclose(file.release()) != 0 && good) {
    good = false;
    problem = errno;
  }
  if (good && std::rename(temporary.c_str(), path.c_str()) != 0) {
    good = false;
    problem = errno;
  }
  if (good) return;
  std::remove(temporary.c_str());
  fail(Status::file, "{}: cannot be written: {}", path, std::strerror(problem));
}

}  // namespace vsplat
