// What the program that uses the library says about the files that it writes and reads, for the whole process.
#pragma once
#include <functional>
#include <string>

namespace vsplat {

struct FileRules {
  std::function<bool(const std::string& path)> may_replace;  // something is there where a file is put; empty: yes
  // A file was put in place, where nothing was (`created`) or of one before.
  std::function<void(const std::string& path, bool created)> written;
  bool allow_outside = false;  // files may name others that lie anywhere (roots.h)
};

// One thread at a time asks and tells.
void set_file_rules(FileRules rules);
bool may_replace(const std::string& path);
void tell_written(const std::string& path, bool created);
bool outside_allowed();

// Renames only where nothing is at `to`, whatever happens meanwhile. False where something is; Error(file), which
// begins with `to`, where it cannot be renamed.
bool rename_to_new(const std::string& from, const std::string& to);

}  // namespace vsplat
