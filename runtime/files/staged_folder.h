// A folder that appears complete or not at all, also when it replaces an earlier one: it is written as
// `.NAME.unfinished` in the same parent folder, then moved into place.
#pragma once
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "runtime/files/folder_lock.h"

namespace vsplat {

class StagedFolder {
 public:
  // Locks `.NAME.unfinished`, and empties it if a process that died left it. Error(file) if another process holds the
  // lock.
  explicit StagedFolder(const std::string& folder);
  // Removes everything again if it was not put in place.
  ~StagedFolder();
  StagedFolder(const StagedFolder&) = delete;
  StagedFolder& operator=(const StagedFolder&) = delete;

  // Where to write.
  const std::filesystem::path& path() const { return staged_; }

  // Moves the folder into place in one step. If a folder exists there, files that `ours` accepts (paths inside of the
  // folder) are replaced if may_replace() allows it, else Error(file); all other files stay.
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
