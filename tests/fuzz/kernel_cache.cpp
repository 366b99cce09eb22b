#include <filesystem>
#include <fstream>

#include "runtime/files/disk_cache.h"
#include "tests/fuzz/targets.h"
#include "tests/support/temporary.h"

namespace vsplat::fuzz {

void kernel_cache(std::string_view bytes) {
  static test::TemporaryFolder folder;
  static const DiskCache cache(folder.path());
  if (bytes.empty()) return;
  const std::string_view rest = bytes.substr(1);
  const std::string path = folder.path() + "/key.bin";
  if (bytes[0] == 's') {
    const std::vector<unsigned char> payload(rest.begin(), rest.end());
    cache.store("key", payload);
    hold(rest.empty() || cache.load("key") == payload, "what is stored is loaded");
    std::filesystem::copy_file(path, folder.path() + "/other.bin", std::filesystem::copy_options::overwrite_existing);
    hold(!cache.load("other"), "and under no other key");
  } else {
    std::ofstream(path, std::ios::binary).write(rest.data(), static_cast<std::streamsize>(rest.size()));
    if (cache.load("key")) {
      hold(rest.size() > 81 && rest.starts_with("vsplat-kernel-"), "an entry that was stored");
    } else {
      hold(!std::filesystem::exists(path), "what is damaged is removed");
    }
  }
}

}  // namespace vsplat::fuzz
