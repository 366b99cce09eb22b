#include "runtime/files/folder_lock.h"

#include "runtime/fail.h"
#include "runtime/system/system.h"

namespace vsplat {

namespace fs = std::filesystem;

FolderLock::FolderLock(const std::string& folder, const std::string& called) {
  try {
    // Another process that created the folder may remove it between two of these calls.
    for (int attempt = 0; attempt < 100; ++attempt) {
      make(folder, called);
      if (hold(folder, called)) return;
    }
    fail(Status::file, "{}: another process creates and removes it again and again", called);
  } catch (...) {
    remove_made();
    throw;
  }
}

FolderLock::~FolderLock() {
  if (held_.good()) remove_made();  // while the lock is held: no other process has begun to write
}

void FolderLock::make(const fs::path& folder, const std::string& called) {
  std::error_code problem;
  if (folder.empty() || fs::is_directory(folder, problem)) return;
  make(folder.has_filename() ? folder.parent_path() : folder.parent_path().parent_path(), called);
  const std::error_code failed = sys::make_folder(folder, sys::Whose::everybody);
  if (!failed)
    made_.push_back(folder);
  else if (failed != std::errc::file_exists || !fs::is_directory(folder, problem))
    fail(Status::file, "{}: cannot be made: {}", called, failed.message());
}

// False if the folder was replaced since it was opened.
bool FolderLock::hold(const std::string& folder, const std::string& called) {
  std::error_code problem;
  sys::Handle opened = sys::open_folder(folder, problem);
  if (problem == std::errc::no_such_file_or_directory) return false;
  if (problem) fail(Status::file, "{}: cannot be opened: {}", called, problem.message());
  const bool ours = sys::lock(opened);
  const std::optional<sys::FileFacts> mine = sys::facts_of(opened, problem), named = sys::facts_of(folder);
  const bool same = mine && named && mine->same_as(*named);
  if (same && ours) {
    held_ = std::move(opened);
    return true;
  }
  if (same)
    fail(Status::file, "{}: another process is writing into this folder: wait until it has ended, or name another one",
         called);
  return false;
}

void FolderLock::remove_made() const {
  for (auto folder = made_.rbegin(); folder != made_.rend(); ++folder) sys::remove_folder(*folder);
}

}  // namespace vsplat
