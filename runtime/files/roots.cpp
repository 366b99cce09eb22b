#include "runtime/files/roots.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "runtime/fail.h"
#include "runtime/files/file_rules.h"
#include "runtime/option.h"
#include "runtime/printable.h"

namespace vsplat {

namespace fs = std::filesystem;

void Roots::add(const fs::path& folder) {
  std::error_code problem;
  if (folder.empty()) return;
  const std::string real = fs::canonical(folder, problem).string();
  if (problem) return;
  const std::string root = real.ends_with('/') ? real : real + "/";
  if (std::find(real_.begin(), real_.end(), root) != real_.end()) return;
  named_.push_back(folder.string());
  real_.push_back(root);
}

const fs::path& Roots::real_folder(const fs::path& folder) {
  const auto known = folders_.find(folder);
  if (known != folders_.end()) return known->second;
  std::error_code problem;
  fs::path real = fs::weakly_canonical(folder.empty() ? "." : folder, problem);
  return folders_.emplace(folder, problem ? fs::path() : real).first->second;
}

bool Roots::hold(const fs::path& file) {
  if (outside_allowed()) return true;
  std::error_code problem;
  // Fast path: most files of a long list are not links and share a folder.
  const fs::path real = fs::is_symlink(file, problem) ? fs::weakly_canonical(file, problem)
                                                      : real_folder(file.parent_path()) / file.filename();
  return std::any_of(real_.begin(), real_.end(),
                     [&](const std::string& root) { return real.string().starts_with(root); });
}

void Roots::need(const fs::path& file, const std::string& who) {
  if (hold(file)) return;
  std::error_code problem;
  const std::string real = fs::weakly_canonical(file, problem).string();
  fail(Status::file,
       "{} {} lies outside {} (after following links, it is {}); put it inside, or permit files outside ({}) if its "
       "origin is trusted",
       who, printable(file.string()), fmt::join(named_, ", "), printable(real), Option::allow_outside);
}

}  // namespace vsplat
