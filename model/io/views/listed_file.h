// Where a file is that a list names: the one search for the pictures and masks of every command.
#pragma once
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "runtime/files/roots.h"

namespace vsplat {

// Whether a file is called like a picture.
bool has_picture_ending(const std::filesystem::path& file);

struct FoundFile {
  std::filesystem::path path;  // empty: there is none
  bool exactly = true;         // false: by a shorter path, another ending or another case than listed
};

// Lists the folders that it looks into once each.
class ListedFiles {
 public:
  // `folders`: where to look, in this order. `written_from`: the folder that listed paths are relative to; nothing
  // where the user says where the files are instead. `roots`, which must outlive this: a file outside them is taken
  // only where no other fits, for its error.
  explicit ListedFiles(std::vector<std::filesystem::path> folders,
                       std::optional<std::filesystem::path> written_from = std::nullopt, Roots* roots = nullptr);

  // In this order: the path as it is written; below each folder; ever shorter tails of it there; and with each tail,
  // the longest first, a file of the same name in another case, then a picture of the same stem with another ending,
  // then one of that stem in another case. A backslash is a slash where no file has it in its name. Nothing but the
  // path as it is written leads out of a folder. Error(input) where two files fit alike.
  FoundFile find(const std::string& name);

  // For a message: where find() has looked for this name, and what nearly fits. A sentence without its full stop.
  std::string where_looked(const std::string& name);

 private:
  struct Folder {
    std::multimap<std::string, std::string> by_lower_name;  // of files and folders
    std::multimap<std::string, std::string> by_lower_stem;  // of pictures
  };

  FoundFile find_slashed(const std::string& name);
  const Folder& list(const std::filesystem::path& folder);
  // The folder below `folder` that `path` leads to, in any case; "" where there is none or more than one.
  std::filesystem::path folder_below(const std::filesystem::path& folder, const std::filesystem::path& path);
  std::filesystem::path nearly(const std::filesystem::path& folder, const std::filesystem::path& tail);
  std::filesystem::path only_one(const std::filesystem::path& folder, std::vector<std::string> names,
                                 const std::filesystem::path& listed);

  std::vector<std::filesystem::path> folders_;
  std::optional<std::filesystem::path> written_from_;
  Roots* roots_;
  std::map<std::filesystem::path, Folder> listed_;
};

}  // namespace vsplat
