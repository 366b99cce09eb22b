#include "model/io/reader/program/mesh_files.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cctype>
#include <cerrno>
#include <cstring>
#include <string_view>

namespace vsplat::read {
namespace {

// Reads fewer than `size` bytes only if the file ends or cannot be read.
std::size_t read_at(const Descriptor& file, std::size_t at, void* to, std::size_t size) {
  std::size_t have = 0;
  while (have < size) {
    const ssize_t n = ::pread(file.number(), static_cast<char*>(to) + have, size - have, static_cast<off_t>(at + have));
    if (n == 0 || (n < 0 && errno != EINTR)) break;
    if (n > 0) have += static_cast<std::size_t>(n);
  }
  return have;
}

class Stream : public Assimp::IOStream {
 public:
  Stream(Descriptor file, std::size_t size) : file_(std::move(file)), size_(size) {}
  explicit Stream(std::string text) : text_(std::move(text)), size_(text_.size()) {}

  std::size_t Read(void* to, std::size_t size, std::size_t count) override {
    if (size == 0 || count == 0) return 0;
    const std::size_t left = size_ - at_, most = count < left / size ? count : left / size;
    std::size_t have = most * size;
    if (file_.good())
      have = read_at(file_, at_, to, have);
    else if (have > 0)
      std::memcpy(to, text_.data() + at_, have);
    at_ += have / size * size;
    return have / size;
  }
  std::size_t Write(const void*, std::size_t, std::size_t) override { return 0; }
  aiReturn Seek(std::size_t offset, aiOrigin from) override {
    const std::size_t base = from == aiOrigin_SET ? 0 : from == aiOrigin_CUR ? at_ : size_;
    const std::size_t to = base + offset;  // a negative offset wraps around, as intended
    if (to > size_) return aiReturn_FAILURE;
    at_ = to;
    return aiReturn_SUCCESS;
  }
  std::size_t Tell() const override { return at_; }
  std::size_t FileSize() const override { return size_; }
  void Flush() override {}

 private:
  Descriptor file_;
  std::string text_;  // used if there is no file
  std::size_t size_, at_ = 0;
};

bool ends_as(const std::string& path, std::string_view ending) {
  return path.size() >= ending.size() &&
         std::equal(ending.begin(), ending.end(), path.end() - static_cast<std::ptrdiff_t>(ending.size()),
                    [](char a, unsigned char b) { return a == std::tolower(b); });
}

}  // namespace

std::optional<std::vector<unsigned char>> whole_file(const std::string& path, Library& library) {
  const Descriptor file = library.open(path);
  struct stat found {};
  if (!file.good() || ::fstat(file.number(), &found) != 0) return std::nullopt;
  std::vector<unsigned char> out(static_cast<std::size_t>(found.st_size));
  out.resize(read_at(file, 0, out.data(), out.size()));
  return out;
}

std::string beginning_of(const std::string& path, Library& library, std::size_t most) {
  const Descriptor file = library.open(path);
  std::string out(most, '\0');
  out.resize(file.good() ? read_at(file, 0, out.data(), most) : 0);
  return out;
}

Assimp::IOStream* MeshFiles::Open(const char* path, const char* mode) {
  if (std::string_view(mode).find_first_of("wa+") != std::string_view::npos) return nullptr;
  if (const bool obj = ends_as(path, ".obj"); obj || ends_as(path, ".mtl")) {
    const auto bytes = whole_file(path, library_);
    if (!bytes) return nullptr;
    std::string text(bytes->begin(), bytes->end());
    if (!obj) return new Stream(materials_.take(path, std::move(text)));
    clean_lines(text);
    text = split_libraries(text);
    materials_.look_for_uses(path, text);
    return new Stream(std::move(text));
  }
  Descriptor file = library_.open(path);
  struct stat found {};
  if (!file.good() || ::fstat(file.number(), &found) != 0) return nullptr;
  return new Stream(std::move(file), static_cast<std::size_t>(found.st_size));
}

}  // namespace vsplat::read
