// Reads and writes whole files, with errors that name the path.
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

// Opens a regular file for reading. Error(file) for anything else (a folder, a pipe without a writer, a device without
// an end), and if it cannot be opened.
std::unique_ptr<std::FILE, FileCloser> open_regular(const std::string& path);

// Reads a file in pieces, from its beginning, while it stays open.
class InputFile {
 public:
  // Throws like open_regular().
  explicit InputFile(const std::string& path);

  // Appends the next `most` bytes, or the rest of the file if that is shorter; Error(file) if it cannot be read.
  void read(std::size_t most, std::vector<unsigned char>& out);
  bool at_end() const { return at_end_; }

 private:
  std::string path_;
  std::unique_ptr<std::FILE, FileCloser> file_;
  bool at_end_ = false;
};

// Throws like open_regular(), and Error(file) if the file cannot be read.
std::vector<unsigned char> read_file(const std::string& path);

// Writes to a temporary name in the same folder and renames, so that a reader sees the old file or the whole new one; a
// failure (Error(file)) leaves nothing behind. The folder must exist.
void write_file(const std::string& path, const void* data, std::size_t size);

}  // namespace vsplat
