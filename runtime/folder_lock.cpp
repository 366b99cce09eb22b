#include "runtime/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "runtime/fail.h"

namespace vsplat {

namespace fs = std::filesystem;

FolderLock::FolderLock(const std::string& folder, const std::string& called) {
  try {
    // Whoever made it may take it away again between two of these calls.
    for (int attempt = 0; attempt < 100; ++attempt) {
      make(folder, called);
      if (hold(folder, called)) return;
    }
    fail(Status::file, "{}: is made and taken away by another process again and again", called);
  } catch (...) {
    remove_made();
    throw;
  }
}

FolderLock::~FolderLock() {
  if (descriptor_ < 0) return;
  remove_made();  // while it is held: nobody else has begun to write
  ::close(descriptor_);
}

void FolderLock::make(const fs::path& folder, const std::string& called) {
  std::error_code problem;
  if (folder.empty() || fs::is_directory(folder, problem)) return;
  make(folder.has_filename() ? folder.parent_path() : folder.parent_path().parent_path(), called);
  if (::mkdir(folder.c_str(), 0777) == 0)
    made_.push_back(folder);
  else if (errno != EEXIST || !fs::is_directory(folder, problem))
    fail(Status::file, "{}: cannot be made: {}", called, std::strerror(errno));
}

// False where the folder is no longer the one of that name.
bool FolderLock::hold(const std::string& folder, const std::string& called) {
  const int opened = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (opened < 0 && errno == ENOENT) return false;
  if (opened < 0) fail(Status::file, "{}: cannot be opened: {}", called, std::strerror(errno));
  const bool held_elsewhere = ::flock(opened, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  struct stat mine {
  }, named{};
  const bool same = ::fstat(opened, &mine) == 0 && ::stat(folder.c_str(), &named) == 0 && mine.st_ino == named.st_ino &&
                    mine.st_dev == named.st_dev;
  if (same && !held_elsewhere) {
    descriptor_ = opened;
    return true;
  }
  ::close(opened);
  if (same)
    fail(Status::file, "{}: another process is writing into this folder: wait until it has ended, or name another one",
         called);
  return false;
}

void FolderLock::remove_made() const {
  for (auto folder = made_.rbegin(); folder != made_.rend(); ++folder) ::rmdir(folder->c_str());
}

}  // namespace vsplat
