#include "runtime/files/output_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cerrno>

#include "runtime/fail.h"
#include "runtime/files/file_rules.h"
#include "runtime/host_span.h"

namespace vsplat {

namespace {

// The error of the last C stream call.
std::error_code stream_error() { return {errno, std::generic_category()}; }

// At most 200 bytes of a name, in whole characters.
std::string short_name(const std::string& name) {
  std::size_t bytes = std::min<std::size_t>(name.size(), 200);
  while (bytes > 0 && bytes < name.size() && (static_cast<unsigned char>(name[bytes]) & 0xc0) == 0x80) --bytes;
  return name.substr(0, bytes);
}

thread_local OutputToMemory* to_memory = nullptr;

}  // namespace

OutputToMemory::OutputToMemory() { to_memory = this; }
OutputToMemory::~OutputToMemory() { to_memory = nullptr; }

OutputFile::OutputFile(const std::string& path, sys::Whose whose) : path_(path), memory_(to_memory) {
  if (memory_) {
    if (memory_->taken_) fail(Status::internal, "{}: a second file in one place in memory", path);
    memory_->taken_ = true;
    return;
  }
  static std::atomic<unsigned> serial{0};
  sys::Handle made;
  std::error_code problem;
  // A process that was killed may have left a file of that name: process numbers repeat in containers. Even for the
  // longest name that a folder allows (255 bytes), the temporary name must be valid.
  const std::filesystem::path place(path);
  const std::string stem = (place.parent_path() / short_name(place.filename().string())).string();
  for (int attempt = 0; attempt < 10000; ++attempt) {
    temporary_ = fmt::format("{}.{}-{}.tmp", stem, sys::process_id(), serial++);
    made = sys::create_new(temporary_, whose, problem);
    if (problem != std::errc::file_exists) break;
  }
  if (problem) fail(Status::file, "{}: cannot be created as {}: {}", path, temporary_, problem.message());
  file_ = sys::stream(std::move(made), "wb", problem);
  if (file_ == nullptr) {
    sys::remove_file(temporary_);
    failed("be opened", problem);
  }
}

OutputFile::~OutputFile() {
  if (file_ == nullptr) return;
  std::fclose(file_);
  sys::remove_file(temporary_);
}

void OutputFile::write(const void* data, std::size_t bytes) {
  if (memory_) {
    memory_->bytes_.append(static_cast<const char*>(data), bytes);
    return;
  }
  const HostSpan span(HostKind::file, "write", path_);
  if (bytes != 0 && std::fwrite(data, 1, bytes, file_) != bytes) failed("be written", stream_error());
}

void OutputFile::commit() {
  if (memory_) return;
  const HostSpan span(HostKind::file, "bring to the disk", path_);
  if (std::fflush(file_) != 0) failed("be written", stream_error());
  if (const std::error_code problem = sys::sync(file_)) failed("be written", problem);
  const bool created = rename_to_new(temporary_, path_);
  if (!created && !may_replace(path_))
    fail(Status::file, "{}: exists, and is kept: it may not be replaced, or was made while this ran", path_);
  std::error_code problem;
  if (!created) std::filesystem::rename(temporary_, path_, problem);
  if (problem) failed("be put in place", problem);
  tell_written(path_, created);
  std::fclose(file_);
  file_ = nullptr;
}

void OutputFile::failed(const char* what, const std::error_code& why) const {
  fail(Status::file, "{}: cannot {}: {}", path_, what, why.message());
}

}  // namespace vsplat
