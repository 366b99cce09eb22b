#include "model/read/program/mesh_files.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string_view>

namespace vsplat::read {
namespace {

class Stream : public Assimp::IOStream {
 public:
  Stream(Descriptor file, std::size_t size) : file_(std::move(file)), size_(size) {}

  std::size_t Read(void* to, std::size_t size, std::size_t count) override {
    if (size == 0 || count == 0) return 0;
    const std::size_t left = size_ - at_, most = count < left / size ? count : left / size;
    std::size_t have = 0;
    while (have < most * size) {
      const ssize_t n =
          ::pread(file_.number(), static_cast<char*>(to) + have, most * size - have, static_cast<off_t>(at_ + have));
      if (n == 0 || (n < 0 && errno != EINTR)) break;
      if (n > 0) have += static_cast<std::size_t>(n);
    }
    at_ += have / size * size;
    return have / size;
  }
  std::size_t Write(const void*, std::size_t, std::size_t) override { return 0; }
  aiReturn Seek(std::size_t offset, aiOrigin from) override {
    const std::size_t base = from == aiOrigin_SET ? 0 : from == aiOrigin_CUR ? at_ : size_;
    const std::size_t to = base + offset;  // a negative offset wraps about, as it is meant to
    if (to > size_) return aiReturn_FAILURE;
    at_ = to;
    return aiReturn_SUCCESS;
  }
  std::size_t Tell() const override { return at_; }
  std::size_t FileSize() const override { return size_; }
  void Flush() override {}

 private:
  Descriptor file_;
  std::size_t size_, at_ = 0;
};

}  // namespace

Assimp::IOStream* MeshFiles::Open(const char* path, const char* mode) {
  if (std::string_view(mode).find_first_of("wa+") != std::string_view::npos) return nullptr;
  Descriptor file = library_.open(path);
  struct stat found {};
  if (!file.good() || ::fstat(file.number(), &found) != 0) return nullptr;
  return new Stream(std::move(file), static_cast<std::size_t>(found.st_size));
}

}  // namespace vsplat::read
