// Compiled kernels on disk, for drivers that keep no cache of their own.
//
//   where   $VSPLAT_CACHE_DIR ("off" disables), else $XDG_CACHE_HOME/vsplat, else ~/.cache/vsplat; created at first use
//   key     SHA-256 of the format's version, the expanded source, the options, and the names and versions of the
//           device, its driver and its platform
//   entry   "vsplat-kernel-2\n", the SHA-256 of key and payload as 64 digits, a line end, the payload
//   safety  written under another name and renamed; an entry that is damaged, foreign, of another key or no regular
//           file counts as absent, and is removed if it is a file; an unwritable folder is not an error; a folder that
//           others may write to is not used, with a warning, since the driver runs the entries as code
#pragma once
#include <optional>
#include <string>
#include <vector>

namespace vsplat {

class DiskCache {
 public:
  // Uses the folder that the environment names; empty: disabled.
  DiskCache();
  explicit DiskCache(std::string folder);

  bool enabled() const { return !folder_.empty(); }
  const std::string& folder() const { return folder_; }
  // Hashes `parts` in order. Their lengths are part of the key, so that no two lists share one.
  static std::string key(const std::vector<std::string>& parts);

  std::optional<std::vector<unsigned char>> load(const std::string& key) const;
  void store(const std::string& key, const std::vector<unsigned char>& payload) const;

 private:
  std::string path(const std::string& key) const { return folder_ + "/" + key + ".bin"; }
  std::string folder_;
};

}  // namespace vsplat
