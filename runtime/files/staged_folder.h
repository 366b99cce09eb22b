// A folder that appears whole or not at all, and replaces an earlier one so: written beside its place, as
// `.NAME.unfinished`.
#pragma once
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "runtime/files/folder_lock.h"

namespace vsplat {

class StagedFolder {
 public:
  // Holds the lock of `.NAME.unfinished`, which is emptied where a process that died has left it. Error(file) where
  // another process is at it.
  explicit StagedFolder(const std::string& folder);
  // Takes all of it away again where it was not put in place.
  ~StagedFolder();
  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;

  // Where to write.
  const std::filesystem::path& path() const { return staged_; }

  // In one step. Of a folder that is there, what `ours` knows (paths in the folder) is replaced where may_replace()
  // says so, else Error(file); what else lies in it stays.
  void put_in_place(const std::function<bool(const std::string& inside)>& ours);

 private:
  void refuse_kept(const std::function<bool(const std::string& inside)>& ours) const;
  void carry_over(const std::function<bool(const std::string& inside)>& ours) const;
  void exchange() const;

  std::string named_;
  std::filesystem::path place_, staged_;
  std::unique_ptr<FolderLock> lock_;
  bool placed_ = false;
};

}  // namespace vsplat
