// The rules of the embedding program for files that the library reads and writes; for the whole process.
#pragma once
#include <functional>
#include <string>

namespace vsplat {

struct FileRules {
  std::function<bool(const std::string& path)> may_replace;  // asked before a file is replaced; empty: yes
  // Called after a file was put in place: `created` if no file was there, false if it replaced one.
  std::function<void(const std::string& path, bool created)> written;
  bool allow_outside = false;  // files may refer to files anywhere (roots.h)
};

// The functions of the rules are called by one thread at a time.
void set_file_rules(FileRules rules);
bool may_replace(const std::string& path);
void tell_written(const std::string& path, bool created);
bool outside_allowed();

// Renames only if `to` does not exist, without a race. Returns false if it exists; Error(file), whose message begins
// with `to`, if it cannot be renamed.
bool rename_to_new(const std::string& from, const std::string& to);

}  // namespace vsplat
