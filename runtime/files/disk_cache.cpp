#include "runtime/files/disk_cache.h"

#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <set>

#include "runtime/error.h"
#include "runtime/files/cache_folders.h"
#include "runtime/files/output_file.h"
#include "runtime/files/sha256.h"
#include "runtime/host_span.h"
#include "runtime/log.h"
#include "runtime/system/system.h"

namespace vsplat {

namespace {

const std::string magic = "vsplat-kernel-2\n";

constexpr std::uint64_t largest_entry = std::uint64_t{1} << 28;  // compiled, our kernels take some hundred kilobytes

// The digest covers the key, so that an entry cannot serve another key.
std::string digest(const std::string& key, const std::vector<unsigned char>& payload) {
  Sha256 hash;
  hash.add(key.data(), key.size());
  hash.add("\n", 1);
  hash.add(payload.data(), payload.size());
  return hash.hex();
}

// In a folder that others may write to, they could place code that the driver then runs as this user.
bool others_may_write(const std::string& folder) {
  const std::optional<sys::FileFacts> found = sys::facts_of(folder);
  return found && found->is_folder() && !found->ours_alone;
}

// Warns once in a process.
void warn_of(const std::string& folder) {
  static std::mutex mutex;
  static auto& warned = *new std::set<std::string>;  // never destroyed: jobs may run until the process ends
  const std::lock_guard lock(mutex);
  if (warned.insert(folder).second)
    warn(
        "{}: others may write to this folder, so no compiled kernel, self-test's verdict or table of tuned parameters "
        "is read from it or stored there: `chmod go-w` it if it is yours, or name another one in VSPLAT_CACHE_DIR",
        folder);
}

// The content of a regular file that other users may not write to; empty if it is not one, or cannot be read.
std::string contents(const sys::Handle& file) {
  std::error_code problem;
  const std::optional<sys::FileFacts> found = sys::facts_of(file, problem);
  if (!found || !found->is_file() || !found->ours_alone || found->size > largest_entry) return "";
  std::string out(static_cast<std::size_t>(found->size), '\0');
  return sys::read_at(file, 0, out.data(), out.size(), problem) == out.size() ? out : "";
}

}  // namespace

DiskCache::DiskCache() : DiskCache(own_cache().path) {}

DiskCache::DiskCache(std::string folder) : folder_(std::move(folder)) {
  if (!enabled() || !others_may_write(folder_)) return;
  warn_of(folder_);
  folder_.clear();
}

std::string DiskCache::key(const std::vector<std::string>& parts) {
  Sha256 hash;
  for (const std::string& part : parts) {
    const std::string length = std::to_string(part.size()) + "\n";
    hash.add(length.data(), length.size());
    hash.add(part.data(), part.size());
  }
  return hash.hex();
}

std::optional<std::vector<unsigned char>> DiskCache::load(const std::string& key) const {
  if (!enabled()) return std::nullopt;
  const HostSpan span(HostKind::file, "read", "compiled kernel");
  std::error_code problem;
  const sys::Handle file = sys::open_to_read(path(key), problem, sys::Links::refused);
  if (problem == std::errc::no_such_file_or_directory) return std::nullopt;
  const std::string text = contents(file);
  const std::size_t head = magic.size() + 65;
  if (text.size() > head && text.compare(0, magic.size(), magic) == 0 && text[head - 1] == '\n') {
    std::vector<unsigned char> payload(text.begin() + static_cast<std::ptrdiff_t>(head), text.end());
    if (text.compare(magic.size(), 64, digest(key, payload)) == 0) return payload;
  }
  verbose("{}: damaged, compiled again", path(key));
  sys::remove_file(path(key));  // a folder of that name stays, and blocks only this entry
  return std::nullopt;
}

void DiskCache::store(const std::string& key, const std::vector<unsigned char>& payload) const {
  if (!enabled()) return;
  const std::filesystem::path folder(folder_);
  std::error_code failed;
  std::filesystem::create_directories(folder.has_filename() ? folder.parent_path() : folder.parent_path().parent_path(),
                                      failed);
  failed = sys::make_folder(folder_, sys::Whose::owner);
  if (failed && failed != std::errc::file_exists) return;
  if (others_may_write(folder_)) return;
  try {
    OutputFile out(path(key), kOwnersAlone);
    out.write(magic + digest(key, payload) + "\n");
    out.write(payload.data(), payload.size());
    out.commit();
  } catch (const Error& e) {  // an unwritable cache only costs time
    verbose("{}", e.what());
  }
}

}  // namespace vsplat
