#include "runtime/disk_cache.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "runtime/error.h"
#include "runtime/log.h"
#include "runtime/output_file.h"
#include "runtime/sha256.h"

namespace vsplat {

namespace {

const std::string magic = "vsplat-kernel-1\n";

std::string folder_from_environment() {
  const auto get = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value ? value : "");
  };
  if (const std::string own = get("VSPLAT_CACHE_DIR"); !own.empty()) return own == "off" ? "" : own;
  if (const std::string xdg = get("XDG_CACHE_HOME"); !xdg.empty()) return xdg + "/vsplat";
  if (const std::string home = get("HOME"); !home.empty()) return home + "/.cache/vsplat";
  return "";
}

std::string digest(const std::vector<unsigned char>& payload) {
  Sha256 hash;
  hash.add(payload.data(), payload.size());
  return hash.hex();
}

}  // namespace

DiskCache::DiskCache() : folder_(folder_from_environment()) {}

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
  std::ifstream in(path(key), std::ios::binary);
  if (!in) return std::nullopt;
  const std::string text((std::istreambuf_iterator<char>(in)), {});
  const std::size_t head = magic.size() + 65;
  if (text.size() > head && text.compare(0, magic.size(), magic) == 0 && text[head - 1] == '\n') {
    std::vector<unsigned char> payload(text.begin() + static_cast<std::ptrdiff_t>(head), text.end());
    if (text.compare(magic.size(), 64, digest(payload)) == 0) return payload;
  }
  verbose("{}: damaged, compiled again", path(key));
  std::error_code ignored;
  std::filesystem::remove(path(key), ignored);
  return std::nullopt;
}

void DiskCache::store(const std::string& key, const std::vector<unsigned char>& payload) const {
  if (!enabled()) return;
  std::error_code failed;
  std::filesystem::create_directories(folder_, failed);
  if (failed) return;
  try {
    OutputFile out(path(key));
    out.write(magic + digest(payload) + "\n");
    out.write(payload.data(), payload.size());
    out.commit();
  } catch (const Error& e) {  // a cache that cannot be written costs time, nothing else
    verbose("{}", e.what());
  }
}

}  // namespace vsplat
