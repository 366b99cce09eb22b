// Folders that must contain every file that another file refers to.
#pragma once
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace vsplat {

class Roots {
 public:
  // Ignores ""; a path that is no folder contains nothing.
  void add(const std::filesystem::path& folder);

  // Whether the file lies in one of them, after links are resolved; always true if the program allows files outside
  // (file_rules.h).
  bool hold(const std::filesystem::path& file);

  // Error(file) if it does not. `who` names the file in the message: a list and its entry, a file and its texture.
  void need(const std::filesystem::path& file, const std::string& who);

 private:
  const std::filesystem::path& real_folder(const std::filesystem::path& folder);

  std::vector<std::string> named_;
  std::vector<std::string> real_;                                   // each ends with a slash
  std::map<std::filesystem::path, std::filesystem::path> folders_;  // resolved folders by their given names
};

}  // namespace vsplat
