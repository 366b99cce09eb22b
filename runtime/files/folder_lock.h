// A folder that one process writes into at a time.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "runtime/handle.h"

namespace vsplat {

// Holds the kernel's lock on the folder itself: no file is left behind, and of a process that has died nothing is.
// Where the file system knows no locks, there is none.
class FolderLock {
 public:
  // Makes the folder and those above it where they are missing. Error(file) where it cannot be made, and where another
  // process, or another FolderLock of this one, holds it; `called` is what the message calls it.
  FolderLock(const std::string& folder, const std::string& called);
  explicit FolderLock(const std::string& folder) : FolderLock(folder, folder) {}
  // Takes away the folders that it made, where they are empty.
  ~FolderLock();
  // Takes none away.
  void keep_folders() { made_.clear(); }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  void make(const std::filesystem::path& folder, const std::string& called);
  bool hold(const std::string& folder, const std::string& called);
  void remove_made() const;

  sys::Handle held_;
  std::vector<std::filesystem::path> made_;  // the outer ones first
};

}  // namespace vsplat
