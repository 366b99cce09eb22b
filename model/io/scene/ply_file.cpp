#include "model/io/scene/ply_file.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "model/io/foreign_file.h"
#include "runtime/fail.h"
#include "runtime/host_span.h"
#include "runtime/system/system.h"

namespace vsplat {

PlyFile::PlyFile(const std::string& path) : path_(path), file_(open_regular(path)) {
  std::error_code problem;
  size_ = std::filesystem::file_size(path, problem);
  if (problem) fail(Status::file, "{}: its size cannot be read: {}", path, problem.message());
}

PlyFile::PlyFile(const std::string& name, std::span<const std::byte> content)
    : path_(name), content_(content), size_(content.size()) {}

std::size_t PlyFile::read(void* to, std::size_t bytes) {
  if (!file_) {
    const std::size_t n = std::min<std::uint64_t>(bytes, size_ - at_);
    if (n > 0) std::memcpy(to, content_.data() + at_, n);
    at_ += n;
    return n;
  }
  const HostSpan span(HostKind::file, "read", path_);
  const std::size_t n = std::fread(to, 1, bytes, file_.get());
  if (n < bytes && std::ferror(file_.get())) fail(Status::file, "{}: cannot be read: {}", path_, std::strerror(errno));
  return n;
}

void PlyFile::seek(std::uint64_t to) {
  if (!file_) {
    at_ = std::min(to, size_);
    return;
  }
  if (const std::error_code problem = sys::seek(file_.get(), to))
    fail(Status::file, "{}: cannot be read at byte {}: {}", path_, to, problem.message());
}

PlyHeader read_ply_header(PlyFile& in) {
  std::string text(static_cast<std::size_t>(std::min<std::uint64_t>(in.size(), kMaxPlyHeader)), '\0');
  text.resize(in.read(text.data(), text.size()));
  if (!text.starts_with("ply"))
    if (const auto other = what_file_is(in.path(), text))
      fail(Status::format, "{}: {}", in.path(), other->where("a PLY file"));
  return parse_ply_header(in.path(), text);
}

}  // namespace vsplat
