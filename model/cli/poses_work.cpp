#include "poses_work.h"

#include <fstream>
#include <stdexcept>
#include <system_error>

#include "outputs.h"

namespace command {
namespace {

namespace fs = std::filesystem;
namespace sys = vsplat::sys;

constexpr const char* record_name = "poses.json";  // a result has it
constexpr const char* state_name = "state.json";   // a folder of work has it

// "a/b/" as "a/b".
fs::path without_slash(const std::string& path) {
  const fs::path out = fs::absolute(path).lexically_normal();
  return out.has_filename() ? out : out.parent_path();
}

bool is_there(const fs::path& path) {
  std::error_code error;
  return fs::exists(fs::symlink_status(path, error));
}

nlohmann::ordered_json read_state(const fs::path& path) {
  std::ifstream in(path);
  return nlohmann::ordered_json::parse(in, nullptr, false);
}

}  // namespace

PosesWork::PosesWork(const std::string& output, bool overwrite)
    : output_(without_slash(output)), folder_(output_.string() + ".unfinished") {
  std::error_code error;
  if (is_there(output_) && !(fs::is_directory(output_, error) && fs::is_empty(output_, error))) {
    if (!is_there(output_ / record_name))
      throw std::runtime_error(output +
                               " exists, and is no folder that an earlier `vsplat poses` wrote: name a new one");
    if (!overwrite) throw std::runtime_error(output + " exists (--overwrite replaces it)");
  }
  if (is_there(folder_) && !is_there(folder_ / state_name) && !fs::is_empty(folder_, error))
    throw std::runtime_error(folder_.string() +
                             " is needed for temporary files, and exists with files of something else: move it away");
}

void PosesWork::open(const Common& common, const nlohmann::ordered_json& request) {
  std::error_code error;
  fs::create_directories(folder_, error);
  lock_ = sys::open_folder(folder_, error);
  if (error) throw std::runtime_error("folder " + folder_.string() + " cannot be made: " + error.message());
  if (!sys::lock(lock_)) throw std::runtime_error(folder_.string() + ": another vsplat works in it");
  state_ = read_state(folder_ / state_name);
  const bool earlier = state_.is_object(),
             same = earlier && state_.value("request", nlohmann::ordered_json()) == request;
  if (same && !is_there(result())) {
    say(common, folder_.string() + ": going on with what an earlier run has finished");
    return;
  }
  if (earlier && !same) say(common, folder_.string() + ": an earlier run had other pictures or options; begins again");
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_)) fs::remove_all(entry.path());
  state_ = {{"request", request}, {"done", nlohmann::ordered_json::array()}};
  write_text((folder_ / state_name).string(), state_.dump(1) + "\n");
  fs::create_directory(folder_ / "logs");
}

bool PosesWork::is_done(const std::string& step) const {
  for (const auto& done : state_["done"])
    if (done == step) return true;
  return false;
}

void PosesWork::finish(const std::string& step) {
  state_["done"].push_back(step);
  write_text((folder_ / state_name).string(), state_.dump(1) + "\n");
}

fs::path PosesWork::new_log(const std::string& name) const {
  fs::path out = folder_ / "logs" / (name + ".txt");
  for (int i = 2; is_there(out); ++i) out = folder_ / "logs" / (name + "-" + std::to_string(i) + ".txt");
  return out;
}

std::vector<fs::path> PosesWork::logs(const std::string& name) const {
  std::vector<fs::path> out;
  fs::path at = folder_ / "logs" / (name + ".txt");
  for (int i = 2; is_there(at); ++i) {
    out.push_back(at);
    at = folder_ / "logs" / (name + "-" + std::to_string(i) + ".txt");
  }
  return out;
}

void PosesWork::publish() {
  fs::rename(folder_ / "logs", result() / "logs");
  std::error_code error;
  fs::create_directories(output_.parent_path(), error);
  if (is_there(output_)) {
    error = sys::exchange(result(), output_);
    if (error) {  // the file system cannot exchange names
      fs::remove_all(output_);
      fs::rename(result(), output_);
    }
  } else {
    fs::rename(result(), output_);
  }
  fs::remove_all(folder_);
}

}  // namespace command
