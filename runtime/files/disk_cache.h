// Compiled kernels on disk, for drivers that keep no cache of their own.
//
//   where   $VSPLAT_CACHE_DIR ("off" disables), else $XDG_CACHE_HOME/vsplat, else ~/.cache/vsplat; made at first use
//   key     SHA-256 of the format's version, the expanded source, the options, and the names and versions of the
//           device, its driver and its platform
//   entry   "vsplat-kernel-2\n", the SHA-256 of key and payload as 64 digits, a line end, the payload
//   safety  written under another name and renamed; an entry that is damaged, foreign, another key's or no file counts
//           as absent, and is removed where it is a file; a folder that cannot be written is not an error; one that
//           others may write to is not used, with a warning: an entry is code that the driver runs
#pragma once
#include <optional>
#include <string>
#include <vector>

namespace vsplat {

class DiskCache {
 public:
  // In the folder that the environment names; empty: disabled.
  DiskCache();
  explicit DiskCache(std::string folder);

  bool enabled() const { return !folder_.empty(); }
  const std::string& folder() const { return folder_; }
  // `parts` in order; their lengths go into the key too, so that no two lists share one.
  static std::string key(const std::vector<std::string>& parts);

  std::optional<std::vector<unsigned char>> load(const std::string& key) const;
  void store(const std::string& key, const std::vector<unsigned char>& payload) const;

 private:
  std::string path(const std::string& key) const { return folder_ + "/" + key + ".bin"; }
  std::string folder_;
};

}  // namespace vsplat
