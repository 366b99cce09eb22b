#include "model/data/object_names.h"

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <set>

namespace vsplat {

namespace fs = std::filesystem;

std::string folder_name(const std::string& folder) {
  const fs::path path = fs::absolute(folder).lexically_normal();
  return (path.has_filename() ? path : path.parent_path()).filename().string();
}

std::vector<std::string> object_names(const std::vector<std::string>& files) {
  std::map<std::string, int> stems;
  for (const std::string& file : files) ++stems[fs::path(file).stem().string()];
  std::vector<std::string> names;
  names.reserve(files.size());
  for (const std::string& file : files) {
    std::string name = fs::path(file).stem().string();
    const std::string folder = folder_name(fs::absolute(file).parent_path().string());
    if ((name == "model" || stems[name] > 1) && !folder.empty()) name = folder;
    names.push_back(name);
  }
  return numbered(std::move(names));
}

std::vector<std::string> numbered(std::vector<std::string> names) {
  std::set<std::string> taken(names.begin(), names.end()), seen;
  std::map<std::string, int> last;
  for (std::string& name : names) {
    if (seen.insert(name).second) continue;
    int& number = last.try_emplace(name, 1).first->second;
    std::string candidate;
    do candidate = fmt::format("{}_{}", name, ++number);
    while (taken.count(candidate) != 0);
    name = candidate;
    taken.insert(name);
    seen.insert(name);
  }
  return names;
}

}  // namespace vsplat
