#include "outputs.h"

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <tuple>
#include <vsplat/vsplat.hpp>

#include "command.h"

namespace command {
namespace fs = std::filesystem;
namespace {

bool outside_allowed = false;

vsplat_file_rules plain_rules() {
  vsplat_file_rules out = VSPLAT_FILE_RULES_INIT;
  out.allow_outside = outside_allowed ? 1 : 0;
  return out;
}

fs::path normal(const std::string& path) { return fs::absolute(path).lexically_normal(); }

bool contains(const std::vector<fs::path>& paths, const fs::path& path) {
  return std::find(paths.begin(), paths.end(), path) != paths.end();
}

// Where the file will lie: links in the path are followed; if the file itself is a link, the link is replaced.
fs::path place_of(const std::string& path) {
  std::error_code problem;
  const fs::path whole = fs::absolute(path), folder = fs::weakly_canonical(whole.parent_path(), problem);
  return problem ? normal(path) : folder / whole.filename();
}

// "a link to gone.ply, which does not exist"
std::string dead_link(const fs::path& link) {
  std::error_code problem;
  return "a link to " + fs::read_symlink(link, problem).string() + ", which is not there";
}

bool is_link(const fs::path& path) {
  std::error_code problem;
  return fs::is_symlink(fs::symlink_status(path, problem));
}

// Checks that the folder of `path`, or its nearest existing parent, accepts a file of that name.
void check_writable(const fs::path& path) {
  const auto refuse = [&](const std::string& why) {
    throw std::runtime_error(path.string() + " cannot be written: " + why);
  };
  std::vector<fs::path> names = {path.filename()};  // to be created in that folder
  fs::path folder = path.parent_path();
  std::error_code error;
  while (!fs::exists(folder, error) && folder.has_parent_path() && folder != folder.parent_path()) {
    if (is_link(folder)) refuse(folder.string() + " is " + dead_link(folder));
    names.push_back(folder.filename());
    folder = folder.parent_path();
  }
  if (!fs::is_directory(folder, error)) refuse(folder.string() + " is not a folder");
  for (const fs::path& name : names) {
    std::ignore = fs::symlink_status(folder / name, error);
    if (error == std::errc::filename_too_long)
      refuse("the name " + name.string() + " has " + std::to_string(name.string().size()) +
             " bytes, which is more than a name in " + folder.string() + " may have");
  }
  std::ignore = fs::symlink_status(path, error);
  if (error == std::errc::filename_too_long)
    refuse("the path has " + std::to_string(path.string().size()) + " bytes, which is more than a path may have");
  if (const std::error_code problem = vsplat::sys::try_new_file_in(folder))
    refuse("folder " + folder.string() + ": " + problem.message());
}

}  // namespace

void allow_outside(bool allowed) {
  outside_allowed = allowed;
  const vsplat_file_rules rules = plain_rules();
  vsplat::check(vsplat_file_rules_set(&rules));
}

Outputs::Outputs(bool overwrite) : overwrite_(overwrite) {
  vsplat_file_rules rules = plain_rules();
  rules.may_replace = on_exists;
  rules.on_written = on_written;
  rules.user = this;
  vsplat::check(vsplat_file_rules_set(&rules));
}

Outputs::~Outputs() {
  const vsplat_file_rules rules = plain_rules();
  [[maybe_unused]] const vsplat_status done = vsplat_file_rules_set(&rules);
  if (!committed_) drop();
}

void Outputs::drop() {
  const std::lock_guard lock(made_mutex_);
  std::error_code ignored;
  std::erase_if(made_, [&](const Made& file) {
    if (!contains(files_, file.path)) return false;
    if (file.still_there()) fs::remove(file.path, ignored);
    return true;
  });
  for (auto folder = folders_.rbegin(); folder != folders_.rend(); ++folder) fs::remove(*folder, ignored);
  files_.clear();
  folders_.clear();
  gone_.clear();
}

bool Outputs::Made::still_there() const {
  const auto there = vsplat::sys::facts_of_entry(path);
  return there && there->same_as(facts);
}

void Outputs::on_written(void* outputs, const char* path, std::int32_t created) {
  auto* self = static_cast<Outputs*>(outputs);
  const std::lock_guard lock(self->made_mutex_);
  const fs::path file = normal(path);
  const auto known =
      std::find_if(self->made_.begin(), self->made_.end(), [&](const Made& m) { return m.path == file; });
  const auto there = vsplat::sys::facts_of_entry(path);
  if ((!created && known == self->made_.end()) || !there) return;
  const Made now{file, *there};
  known == self->made_.end() ? self->made_.push_back(now) : static_cast<void>(*known = now);
}

// A file that did not exist at first may be another program's by now; this process may rewrite only what it created.
std::int32_t Outputs::on_exists(void* outputs, const char* path) {
  auto* self = static_cast<Outputs*>(outputs);
  const std::lock_guard lock(self->made_mutex_);
  const fs::path file = normal(path);
  if (!contains(self->kept_, file)) return 1;
  for (const Made& made : self->made_)
    if (made.path == file && made.still_there()) return 1;
  return 0;
}

void Outputs::refuse_if_same(const std::string& path, const fs::path& output, const fs::path& input) {
  std::error_code error;
  if (output == input || fs::equivalent(output, input, error))
    throw UsageError(path + " is read, so it cannot be the output, too");
}

void Outputs::input(const std::string& path) {
  if (path.empty()) return;
  inputs_.push_back(normal(path));
  for (const fs::path& output : expected_) refuse_if_same(path, output, inputs_.back());
  for (const fs::path& output : gone_) refuse_if_same(path, output, inputs_.back());
}

void Outputs::input_cameras(const std::string& path) {
  input(path);
  std::error_code error;
  if (path.empty() || !fs::is_directory(path, error)) return;
  for (const char* folder : {"", "sparse", "sparse/0", "colmap/sparse/0"})
    for (const char* name : {"transforms.json", "cameras.json", "cameras.bin", "cameras.txt", "images.bin",
                             "images.txt", "points3D.bin", "points3D.txt"})
      if (const fs::path file = fs::path(path) / folder / name; fs::is_regular_file(file, error)) input(file.string());
}

void Outputs::input_data(const std::vector<std::string>& paths) {
  std::error_code error;
  const auto is_below = [&](const fs::path& file, const std::string& path) {
    const std::string inside = fs::weakly_canonical(file, error).lexically_relative(fs::weakly_canonical(path, error));
    return !inside.empty() && !inside.starts_with("..");
  };
  for (const std::string& path : paths)
    if (!fs::is_directory(path, error)) input(path);
  // Listing a set's files takes long, so it is done only if an output might be one of them.
  for (const fs::path& output : std::vector<fs::path>(expected_)) {
    if (!fs::exists(output, error) ||
        std::none_of(paths.begin(), paths.end(), [&](const std::string& path) { return is_below(output, path); }))
      continue;
    const vsplat::DataSet set(paths);
    vsplat_views_options checked_later = VSPLAT_VIEWS_OPTIONS_INIT;
    checked_later.check_later = 1;
    for (std::size_t i = 0; i < set.count(); ++i) {
      const auto object = nlohmann::json::parse(set.describe(i));
      const std::string path = object["path"].get<std::string>();
      input_cameras(path);
      if (object["layout"] == "hdf5") continue;
      try {
        for (const std::string& file : vsplat::Views::load(path, checked_later).files()) input(file);
      } catch (const vsplat::Error&) {  // an unreadable view is reported where it is read
      }
    }
    return;
  }
}

void Outputs::expect_gone(const std::string& path) {
  if (!overwrite_) return;
  const fs::path file = normal(path);
  for (const fs::path& input : inputs_) refuse_if_same(path, file, input);
  gone_.push_back(file);
}

void Outputs::refuse_if_gone() {
  const std::lock_guard lock(made_mutex_);
  std::vector<fs::path> written = files_;
  for (const Made& made : made_)
    if (contains(expected_, made.path)) written.push_back(made.path);
  std::error_code ignored;
  for (const fs::path& file : written)
    if (!fs::exists(fs::symlink_status(file, ignored)))
      throw std::runtime_error(file.string() +
                               " was written and is gone: something else has removed it, or its folder");
}

void Outputs::keep() {
  refuse_if_gone();
  stay_.insert(stay_.end(), files_.begin(), files_.end());
  files_.clear();
  folders_.clear();
  std::error_code ignored;
  for (const fs::path& file : gone_) fs::remove(file, ignored);
  gone_.clear();
}

void Outputs::commit() {
  keep();
  committed_ = true;
}

void Outputs::expect(const std::string& path) { expect(path, overwrite_); }

void Outputs::expect_renewed(const std::string& path) { expect(path, true); }

// Two names may refer to one file, since a link can give a folder a second name.
void Outputs::refuse_if_expected(const std::string& path) {
  const fs::path place = place_of(path);
  if (const auto other = places_.find(place); other != places_.end())
    throw UsageError(path + " would be written twice" +
                     (other->second == path ? "" : ", since " + other->second + " is the same file") +
                     ": give each output a name of its own");
  if (const auto inside = parents_.find(place); inside != parents_.end())
    throw UsageError(path + " would be a file and the folder of " + inside->second +
                     ": give each output a name of its own");
  places_.emplace(place, path);
  for (fs::path folder = place.parent_path();; folder = folder.parent_path()) {
    if (const auto file = places_.find(folder); file != places_.end())
      throw UsageError(file->second + " would be a file and the folder of " + path +
                       ": give each output a name of its own");
    if (!parents_.emplace(folder, path).second || folder == folder.parent_path()) break;
  }
}

void Outputs::expect(const std::string& path, bool renewed) {
  if (path.empty()) return;
  const fs::path file = normal(path);
  refuse_if_expected(path);
  for (const fs::path& input : inputs_) refuse_if_same(path, file, input);
  expected_.push_back(file);
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status) && is_link(file) && !renewed)
    throw std::runtime_error(path + " is " + dead_link(file) + " (--overwrite replaces the link)");
  if (fs::exists(status)) {
    if (!fs::is_regular_file(status)) throw std::runtime_error(path + " exists and is not a file");
    if (!renewed) throw std::runtime_error(path + " exists (--overwrite replaces it)");
  }
  if (!renewed) kept_.push_back(file);
  check_writable(file);
}

void Outputs::make_folder(const fs::path& folder) {
  std::error_code error;
  if (folder.empty() || fs::is_directory(folder, error)) return;
  make_folder(folder.parent_path());
  if (!fs::create_directory(folder, error) && error)
    throw std::runtime_error("folder " + folder.string() + " cannot be made: " + error.message());
  folders_.push_back(folder);
}

std::string Outputs::begin(const std::string& path) {
  const fs::path file = normal(path);
  make_folder(file.parent_path());
  if (!contains(stay_, file)) files_.push_back(file);  // a file kept from before is replaced whole, never removed
  return path;
}

void write_text(const std::string& path, const std::string& text) {
  vsplat::check(vsplat_file_write(path.c_str(), text.data(), text.size()));
}

}  // namespace command
