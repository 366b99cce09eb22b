// A PLY file's bytes, read from front to back, with the size known beforehand.
#pragma once
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <span>
#include <string>

#include "model/io/scene/ply_header.h"
#include "runtime/files/file.h"

namespace vsplat {

class PlyFile {
 public:
  // As open_regular().
  explicit PlyFile(const std::string& path);
  // The same of a file's bytes in memory, which must outlive it; `name` stands for the path in errors.
  PlyFile(const std::string& name, std::span<const std::byte> content);

  const std::string& path() const { return path_; }
  std::uint64_t size() const { return size_; }
  // Fewer bytes than asked for at the end of the file only.
  std::size_t read(void* to, std::size_t bytes);
  void seek(std::uint64_t to);

 private:
  std::string path_;
  std::unique_ptr<std::FILE, FileCloser> file_;  // none: of memory
  std::span<const std::byte> content_;
  std::uint64_t size_ = 0, at_ = 0;  // at_: in the content
};

// From the file's beginning. Errors as parse_ply_header().
PlyHeader read_ply_header(PlyFile& in);

}  // namespace vsplat
