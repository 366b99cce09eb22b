// Whole files in and out, with errors that name the path.
#pragma once
#include <cstddef>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

namespace vsplat {

struct FileCloser {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

// Opens a regular file for reading. Error(file) for anything else (a folder, a pipe that nobody may write to, a device
// without an end), and where it cannot be opened.
std::unique_ptr<std::FILE, FileCloser> open_regular(const std::string& path);

// A file read from its beginning, in pieces, while it stays open.
class InputFile {
 public:
  // As open_regular().
  explicit InputFile(const std::string& path);

  // Appends the next `most` bytes, or what is left of the file where that is less; Error(file) where it cannot be read.
  void read(std::size_t most, std::vector<unsigned char>& out);
  bool at_end() const { return at_end_; }

 private:
  std::string path_;
  std::unique_ptr<std::FILE, FileCloser> file_;
  bool at_end_ = false;
};

// As open_regular(); Error(file) where it cannot be read, too.
std::vector<unsigned char> read_file(const std::string& path);

// Writes to a temporary name in the same folder and renames, so that a reader sees the old file or the whole new one; a
// failure (Error(file)) leaves nothing behind. The folder must exist.
void write_file(const std::string& path, const void* data, std::size_t size);

}  // namespace vsplat
