// A lock on a folder, into which only one process writes at a time.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "runtime/system/os_handle.h"

namespace vsplat {

// Holds the kernel's lock on the folder itself: it leaves no lock file behind, and ends with its process. On a file
// system without locks there is no protection.
class FolderLock {
 public:
  // Creates the folder and its missing parents. Error(file) if it cannot be created, or if another process, or another
  // FolderLock of this one, holds the lock; messages call the folder `called`.
  FolderLock(const std::string& folder, const std::string& called);
  explicit FolderLock(const std::string& folder) : FolderLock(folder, folder) {}
  // Removes the folders that it created, if they are empty.
  ~FolderLock();
  // Keeps all folders.
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
