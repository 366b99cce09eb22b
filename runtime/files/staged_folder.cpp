#include "runtime/files/staged_folder.h"

#include <fmt/format.h>

#include "runtime/fail.h"
#include "runtime/files/file_rules.h"
#include "runtime/system/system.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

// Resolves links and removes a trailing slash.
fs::path real_place(const std::string& folder) {
  std::error_code problem;
  fs::path out = fs::weakly_canonical(fs::absolute(folder), problem);
  if (problem) fail(Status::file, "{}: cannot be written: {}", folder, problem.message());
  if (!out.has_filename()) out = out.parent_path();
  if (out.filename().empty()) fail(Status::file, "{}: is no folder that can be replaced", folder);
  return out;
}

bool is_there(const fs::path& path) {
  std::error_code ignored;
  return fs::symlink_status(path, ignored).type() != fs::file_type::not_found;
}

// Visits each entry below `root`, with its path relative to it; a folder comes before its content.
void walk(const fs::path& root, const std::function<void(const fs::directory_entry&, const std::string&)>& visit) {
  std::error_code problem;
  for (auto at = fs::recursive_directory_iterator(root, problem); !problem && at != fs::recursive_directory_iterator();
       at.increment(problem))
    visit(*at, at->path().lexically_relative(root).string());
  if (problem) fail(Status::file, "{}: the folder cannot be read: {}", root.string(), problem.message());
}

bool is_folder(const fs::directory_entry& entry) { return fs::is_directory(entry.symlink_status()); }

}  // namespace

StagedFolder::StagedFolder(const std::string& folder) : named_(folder), place_(real_place(folder)) {
  staged_ = place_.parent_path() / fmt::format(".{}.unfinished", place_.filename().string());
  lock_ = std::make_unique<FolderLock>(staged_.string(), folder);
  std::error_code problem;
  for (const fs::directory_entry& left : fs::directory_iterator(staged_, problem)) fs::remove_all(left, problem);
  if (problem) fail(Status::file, "{}: cannot be emptied: {}", staged_.string(), problem.message());
}

StagedFolder::~StagedFolder() {
  std::error_code ignored;
  if (!placed_) fs::remove_all(staged_, ignored);
}

void StagedFolder::refuse_kept(const std::function<bool(const std::string& inside)>& ours) const {
  walk(place_, [&](const fs::directory_entry& entry, const std::string& inside) {
    const std::string path = (fs::path(named_) / inside).string();
    if (!is_folder(entry) && ours(inside) && !may_replace(path))
      fail(Status::file, "{}: exists, made by another process meanwhile; it is kept", path);
  });
}

// Uses hard links, so that the folder of that name has the files at every moment.
void StagedFolder::carry_over(const std::function<bool(const std::string& inside)>& ours) const {
  walk(place_, [&](const fs::directory_entry& entry, const std::string& inside) {
    const fs::path to = staged_ / inside;
    if (is_there(to) || (!is_folder(entry) && ours(inside))) return;
    const std::error_code problem =
        is_folder(entry) ? sys::make_folder(to, sys::Whose::everybody) : sys::link(entry.path(), to);
    if (problem)
      fail(Status::file, "{}: is not one of the files that are replaced, but cannot be kept: {}; move it elsewhere",
           entry.path().string(), problem.message());
  });
}

void StagedFolder::exchange() const {
  std::error_code problem = sys::exchange(staged_, place_);
  if (!problem) return;
  // A file system without rename flags needs two steps.
  if (problem == std::errc::invalid_argument || problem == std::errc::function_not_supported) {
    const fs::path before = staged_.string() + ".before";
    fs::rename(place_, before, problem);
    if (!problem) {
      fs::rename(staged_, place_, problem);
      if (!problem) fs::rename(before, staged_, problem);
      if (!problem) return;
      std::error_code ignored;
      fs::rename(before, place_, ignored);
    }
  }
  fail(Status::file, "{}: cannot be replaced: {}", place_.string(), problem.message());
}

void StagedFolder::put_in_place(const std::function<bool(const std::string& inside)>& ours) {
  if (!is_there(place_) && rename_to_new(staged_.string(), place_.string())) {
    placed_ = true;
    lock_->keep_folders();
    return;
  }
  std::error_code ignored;
  if (!fs::is_directory(place_, ignored)) fail(Status::file, "{}: exists and is no folder", place_.string());
  // The old folder takes the staged folder's name, which other processes lock, until it is deleted.
  const FolderLock old(place_.string());
  refuse_kept(ours);
  carry_over(ours);
  exchange();
  placed_ = true;
  lock_->keep_folders();
  std::error_code problem;
  fs::remove_all(staged_, problem);
}

}  // namespace vsplat
