#include "runtime/disk_cache.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <mutex>
#include <set>

#include "runtime/cache_folders.h"
#include "runtime/error.h"
#include "runtime/host_span.h"
#include "runtime/log.h"
#include "runtime/output_file.h"
#include "runtime/sha256.h"

namespace vsplat {

namespace {

const std::string magic = "vsplat-kernel-2\n";

constexpr off_t largest_entry = off_t{1} << 28;  // compiled, our kernels take some hundred kilobytes

// An entry of one key is none of another.
std::string digest(const std::string& key, const std::vector<unsigned char>& payload) {
  Sha256 hash;
  hash.add(key.data(), key.size());
  hash.add("\n", 1);
  hash.add(payload.data(), payload.size());
  return hash.hex();
}

bool ours_alone(const struct stat& what) {
  return (what.st_uid == ::geteuid() || what.st_uid == 0) && (what.st_mode & (S_IWGRP | S_IWOTH)) == 0;
}

// Others could put there what the driver then runs as us.
bool others_may_write(const std::string& folder) {
  struct stat found {};
  return ::stat(folder.c_str(), &found) == 0 && S_ISDIR(found.st_mode) && !ours_alone(found);
}

// Once in a process.
void warn_of(const std::string& folder) {
  static std::mutex mutex;
  static std::set<std::string> warned;
  const std::lock_guard lock(mutex);
  if (warned.insert(folder).second)
    warn(
        "{}: others may write to this folder, so that no compiled kernel, self-test's verdict or table of tuned "
        "parameters is taken from it or kept there: `chmod go-w` it where it is yours, or name another one in "
        "VSPLAT_CACHE_DIR",
        folder);
}

class Descriptor {
 public:
  explicit Descriptor(const std::string& path)
      : number_(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW)) {}
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int number() const { return number_; }

 private:
  int number_;
};

// Of a regular file that nobody else may write to; empty where it is none, or cannot be read.
std::string contents(const Descriptor& file) {
  struct stat found {};
  if (file.number() < 0 || ::fstat(file.number(), &found) != 0 || !S_ISREG(found.st_mode) || !ours_alone(found) ||
      found.st_size > largest_entry)
    return "";
  std::string out(static_cast<std::size_t>(found.st_size), '\0');
  std::size_t at = 0;
  while (at < out.size()) {
    const ssize_t got = ::read(file.number(), out.data() + at, out.size() - at);
    if (got <= 0) return "";
    at += static_cast<std::size_t>(got);
  }
  return out;
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
  const Descriptor file(path(key));
  if (file.number() < 0 && errno == ENOENT) return std::nullopt;
  const std::string text = contents(file);
  const std::size_t head = magic.size() + 65;
  if (text.size() > head && text.compare(0, magic.size(), magic) == 0 && text[head - 1] == '\n') {
    std::vector<unsigned char> payload(text.begin() + static_cast<std::ptrdiff_t>(head), text.end());
    if (text.compare(magic.size(), 64, digest(key, payload)) == 0) return payload;
  }
  verbose("{}: damaged, compiled again", path(key));
  ::unlink(path(key).c_str());  // a folder stays, and is in the way of no more than this entry
  return std::nullopt;
}

void DiskCache::store(const std::string& key, const std::vector<unsigned char>& payload) const {
  if (!enabled()) return;
  const std::filesystem::path folder(folder_);
  std::error_code failed;
  std::filesystem::create_directories(folder.has_filename() ? folder.parent_path() : folder.parent_path().parent_path(),
                                      failed);
  if (::mkdir(folder_.c_str(), 0700) != 0 && errno != EEXIST) return;
  if (others_may_write(folder_)) return;
  try {
    OutputFile out(path(key), kOwnersAlone);
    out.write(magic + digest(key, payload) + "\n");
    out.write(payload.data(), payload.size());
    out.commit();
  } catch (const Error& e) {  // a cache that cannot be written costs time, nothing else
    verbose("{}", e.what());
  }
}

}  // namespace vsplat
