#include "model/io/any_case.h"

#include <algorithm>
#include <cctype>

namespace vsplat {
namespace fs = std::filesystem;

std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return c < 0x80 ? static_cast<char>(std::tolower(c)) : static_cast<char>(c); });
  return text;
}

fs::path in_any_case(const fs::path& folder, const std::string& name) {
  std::error_code error;
  if (fs::exists(folder / name, error)) return folder / name;
  const std::string wanted = lower_case(name);
  std::string found;
  constexpr int most = 10000;  // larger folders hold pictures and are not searched
  int seen = 0;
  for (fs::directory_iterator at(folder.empty() ? "." : folder, error), end; !error && at != end; at.increment(error)) {
    if (++seen > most) return folder / name;
    const std::string entry = at->path().filename().string();
    if (entry.size() != wanted.size() || lower_case(entry) != wanted) continue;
    if (!found.empty()) return folder / name;
    found = entry;
  }
  return folder / (found.empty() ? name : found);
}

}  // namespace vsplat
