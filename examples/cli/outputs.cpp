#include "outputs.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>

#include "command.h"

namespace command {
namespace fs = std::filesystem;
namespace {

fs::path normal(const std::string& path) { return fs::absolute(path).lexically_normal(); }

// The folder `path` would be written into, or the nearest one above it that is there, takes a file.
void check_writable(const fs::path& path) {
  fs::path folder = path.parent_path();
  std::error_code error;
  while (!fs::exists(folder, error) && folder.has_parent_path() && folder != folder.parent_path())
    folder = folder.parent_path();
  if (!fs::is_directory(folder, error))
    throw std::runtime_error(path.string() + " cannot be written: " + folder.string() + " is not a folder");
  // access() says yes to root where the file system says no: try.
  std::string probe = (folder / ".vsplat-XXXXXX").string();
  const int file = mkstemp(probe.data());
  if (file < 0)
    throw std::runtime_error(path.string() + " cannot be written: folder " + folder.string() + ": " +
                             std::strerror(errno));
  close(file);
  unlink(probe.c_str());
}

}  // namespace

Outputs::~Outputs() {
  if (committed_) return;
  std::error_code ignored;
  for (const fs::path& file : files_) fs::remove(file, ignored);
  for (auto folder = folders_.rbegin(); folder != folders_.rend(); ++folder) fs::remove(*folder, ignored);
}

void Outputs::refuse_if_same(const std::string& path, const fs::path& output, const fs::path& input) {
  std::error_code error;
  if (output == input || fs::equivalent(output, input, error))
    throw UsageError(path + " is read and cannot be the output, too");
}

void Outputs::input(const std::string& path) {
  if (path.empty()) return;
  inputs_.push_back(normal(path));
  for (const fs::path& output : expected_) refuse_if_same(path, output, inputs_.back());
  for (const fs::path& output : gone_) refuse_if_same(path, output, inputs_.back());
}

void Outputs::expect_gone(const std::string& path) {
  if (!overwrite_) return;
  const fs::path file = normal(path);
  for (const fs::path& input : inputs_) refuse_if_same(path, file, input);
  gone_.push_back(file);
}

void Outputs::commit() {
  committed_ = true;
  std::error_code ignored;
  for (const fs::path& file : gone_) fs::remove(file, ignored);
}

void Outputs::expect(const std::string& path) {
  if (path.empty()) return;
  const fs::path file = normal(path);
  if (std::find(expected_.begin(), expected_.end(), file) != expected_.end())
    throw UsageError(path + " would be written twice: give each output a name of its own");
  for (const fs::path& input : inputs_) refuse_if_same(path, file, input);
  expected_.push_back(file);
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (fs::exists(status)) {
    if (!fs::is_regular_file(status)) throw std::runtime_error(path + " exists and is not a file");
    if (!overwrite_) throw std::runtime_error(path + " exists (--overwrite replaces it)");
  }
  check_writable(file);
}

void Outputs::make_folder(const fs::path& folder) {
  std::error_code error;
  if (folder.empty() || fs::is_directory(folder, error)) return;
  make_folder(folder.parent_path());
  if (!fs::create_directory(folder, error) && error)
    throw std::runtime_error("folder " + folder.string() + " cannot be made: " + error.message());
  folders_.push_back(folder);
}

std::string Outputs::begin(const std::string& path) {
  const fs::path file = normal(path);
  make_folder(file.parent_path());
  std::error_code error;
  if (!fs::exists(file, error)) files_.push_back(file);  // a file from before is replaced whole, never taken away
  return path;
}

void write_text(const std::string& path, const std::string& text) {
  const std::string temporary = path + ".vsplat-" + std::to_string(getpid());
  std::FILE* file = std::fopen(temporary.c_str(), "wb");
  if (!file) throw std::runtime_error(path + " cannot be written: " + std::strerror(errno));
  const bool written = std::fwrite(text.data(), 1, text.size(), file) == text.size();
  if ((std::fclose(file) != 0) || !written || std::rename(temporary.c_str(), path.c_str()) != 0) {
    const std::string reason = std::strerror(errno);
    std::remove(temporary.c_str());
    throw std::runtime_error(path + " cannot be written: " + reason);
  }
}

}  // namespace command
