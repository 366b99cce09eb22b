#include "runtime/files/file_rules.h"

#include <memory>
#include <mutex>

#include "runtime/fail.h"
#include "runtime/system/system.h"

namespace vsplat {

namespace fs = std::filesystem;

namespace {

// The rules' functions may call back: they may write another file, or set other rules. So the mutex is recursive, and
// rules are kept for as long as one of their functions runs. Both outlive every thread.
std::recursive_mutex& rules_mutex() {
  static auto& mutex = *new std::recursive_mutex;
  return mutex;
}

std::shared_ptr<const FileRules>& current() {
  static auto& rules = *new auto(std::make_shared<const FileRules>());
  return rules;
}

}  // namespace

void set_file_rules(FileRules rules) {
  const std::lock_guard lock(rules_mutex());
  current() = std::make_shared<const FileRules>(std::move(rules));
}

bool may_replace(const std::string& path) {
  const std::lock_guard lock(rules_mutex());
  const std::shared_ptr<const FileRules> rules = current();
  return !rules->may_replace || rules->may_replace(path);
}

void tell_written(const std::string& path, bool created) {
  const std::lock_guard lock(rules_mutex());
  const std::shared_ptr<const FileRules> rules = current();
  if (rules->written) rules->written(path, created);
}

bool outside_allowed() {
  const std::lock_guard lock(rules_mutex());
  return current()->allow_outside;
}

bool rename_to_new(const std::string& from, const std::string& to) {
  std::error_code problem = sys::rename_to_new(from, to), ignored;
  if (!problem) return true;
  if (problem == std::errc::invalid_argument || problem == std::errc::function_not_supported) {
    problem = sys::link(from, to);  // a file system without rename flags
    if (!problem) {
      sys::remove_file(from);
      return true;
    }
    // No hard links either: the only way left is to look first.
    if (problem != std::errc::file_exists && fs::symlink_status(to, ignored).type() == fs::file_type::not_found) {
      fs::rename(from, to, problem);
      if (!problem) return true;
    }
    if (fs::exists(fs::symlink_status(to, ignored))) return false;
  }
  if (problem == std::errc::file_exists || problem == std::errc::directory_not_empty) return false;
  fail(Status::file, "{}: cannot be put in place: {}", to, problem.message());
}

}  // namespace vsplat
