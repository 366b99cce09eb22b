// Locates the files that a list names. All commands use this search for pictures and masks.
#pragma once
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "runtime/files/roots.h"

namespace vsplat {

// Whether a file has a picture's ending.
bool has_picture_ending(const std::filesystem::path& file);

struct FoundFile {
  std::filesystem::path path;  // empty if there is none
  bool exactly = true;         // false: found by a shorter path, another ending, case or Unicode form, or decoded
};

// Lists each folder that it searches only once.
class ListedFiles {
 public:
  // `folders`: where to search, in this order. `written_from`: the folder that listed paths are relative to; none if
  // the user has named the folder of the files instead. `roots`, which must outlive this: a file outside them is
  // returned only if no other file matches, so that the caller can report it.
  explicit ListedFiles(std::vector<std::filesystem::path> folders,
                       std::optional<std::filesystem::path> written_from = std::nullopt, Roots* roots = nullptr);

  // Search order: the path as written; the path below each folder; ever shorter tails of it there; then for each tail,
  // longest first, a file of the same name in another case, a picture of the same stem with another ending, and one of
  // that stem in another case. In each step the Unicode form makes no difference, unless a file has the listed one. A
  // backslash counts as a slash unless a file has it in its name. Only the path as written may lead out of a folder.
  // Error(input) if two files match equally well.
  FoundFile find(const std::string& name);

  // The same for a file that need not be a picture: only one with the listed ending. "" if there is none.
  std::filesystem::path find_with_ending(const std::string& name);

  // For a message: the places where find() searched for this name, and similar names. A sentence without its full stop.
  std::string where_looked(const std::string& name);

 private:
  struct Folder {
    std::multimap<std::string, std::string> by_folded_name;  // files and folders
    std::multimap<std::string, std::string> by_folded_stem;  // pictures
  };

  FoundFile find_as(const std::string& name);
  FoundFile find_slashed(const std::string& name);
  const Folder& list(const std::filesystem::path& folder);
  // The file below `folder` that `path` names: the exact one, else the one whose path differs in its Unicode form only.
  FoundFile in_any_form(const std::filesystem::path& folder, const std::filesystem::path& path);
  void add_in_any_form(const std::filesystem::path& folder, const std::filesystem::path& below,
                       std::filesystem::path::const_iterator part, std::filesystem::path::const_iterator end,
                       std::vector<std::string>& out);
  // The folder below `folder` that `path` names, ignoring case; "" if there is none or more than one.
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
