#include "runtime/file_rules.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <mutex>

#include "runtime/fail.h"

namespace vsplat {
namespace {

std::mutex& rules_mutex() {
  static std::mutex mutex;
  return mutex;
}

FileRules& current() {
  static FileRules rules;
  return rules;
}

}  // namespace

void set_file_rules(FileRules rules) {
  const std::lock_guard lock(rules_mutex());
  current() = std::move(rules);
}

bool may_replace(const std::string& path) {
  const std::lock_guard lock(rules_mutex());
  return !current().may_replace || current().may_replace(path);
}

void tell_written(const std::string& path, bool created) {
  const std::lock_guard lock(rules_mutex());
  if (current().written) current().written(path, created);
}

bool outside_allowed() {
  const std::lock_guard lock(rules_mutex());
  return current().allow_outside;
}

bool rename_to_new(const std::string& from, const std::string& to) {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) return true;
  if (errno == EINVAL || errno == ENOSYS) {  // of a file system that knows no flags
    if (::link(from.c_str(), to.c_str()) == 0) {
      ::unlink(from.c_str());
      return true;
    }
    // Neither links: nobody can do better than to look first.
    struct stat there {};
    if (errno != EEXIST && ::lstat(to.c_str(), &there) != 0 && errno == ENOENT &&
        ::rename(from.c_str(), to.c_str()) == 0)
      return true;
    if (::lstat(to.c_str(), &there) == 0) return false;
  }
  if (errno == EEXIST || errno == ENOTEMPTY) return false;
  fail(Status::file, "{}: cannot be put in place: {}", to, std::strerror(errno));
}

}  // namespace vsplat
