// Folders in which files that other files name have to lie.
#pragma once
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace vsplat {

class Roots {
 public:
  // "" is none; what is no folder holds nothing.
  void add(const std::filesystem::path& folder);

  // Whether the file lies in one of them, links followed; always where the program allows files outside
  // (file_rules.h).
  bool hold(const std::filesystem::path& file);

  // Error(file) where it does not. `who` names it: a list and what of it, a file and its texture.
  void need(const std::filesystem::path& file, const std::string& who);

 private:
  const std::filesystem::path& real_folder(const std::filesystem::path& folder);

  std::vector<std::string> named_;
  std::vector<std::string> real_;                                   // each with a slash at its end
  std::map<std::filesystem::path, std::filesystem::path> folders_;  // real ones by their names
};

}  // namespace vsplat
