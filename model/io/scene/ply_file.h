// Sequential access to a PLY file's bytes, with the size known beforehand.
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
  // Errors as open_regular().
  explicit PlyFile(const std::string& path);
  // A file's bytes in memory, which must outlive this; `name` replaces the path in errors.
  PlyFile(const std::string& name, std::span<const std::byte> content);

  const std::string& path() const { return path_; }
  std::uint64_t size() const { return size_; }
  // Returns fewer bytes than requested only at the end of the file.
  std::size_t read(void* to, std::size_t bytes);
  void seek(std::uint64_t to);

 private:
  std::string path_;
  std::unique_ptr<std::FILE, FileCloser> file_;  // null for a file in memory
  std::span<const std::byte> content_;
  std::uint64_t size_ = 0, at_ = 0;  // at_: position in content_
};

// Reads from the file's beginning. Errors as parse_ply_header().
PlyHeader read_ply_header(PlyFile& in);

}  // namespace vsplat
