#include "model/io/ply_file.h"

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "runtime/fail.h"
#include "runtime/host_span.h"

namespace vsplat {

PlyFile::PlyFile(const std::string& path) : path_(path), file_(open_regular(path)) {
  std::error_code problem;
  size_ = std::filesystem::file_size(path, problem);
  if (problem) fail(Status::file, "{}: its size cannot be told: {}", path, problem.message());
}

std::size_t PlyFile::read(void* to, std::size_t bytes) {
  const HostSpan span(HostKind::file, "read", path_);
  const std::size_t n = std::fread(to, 1, bytes, file_.get());
  if (n < bytes && std::ferror(file_.get())) fail(Status::file, "{}: cannot be read: {}", path_, std::strerror(errno));
  return n;
}

void PlyFile::seek(std::uint64_t to) {
  if (fseeko(file_.get(), static_cast<off_t>(to), SEEK_SET) != 0)
    fail(Status::file, "{}: cannot be read at byte {}: {}", path_, to, std::strerror(errno));
}

}  // namespace vsplat
