// The user's COLMAP: found and examined, and its commands run. Names of its options differ by version, so each command
// is asked which it has.
#pragma once
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

namespace command {

// An option by its names in the versions of COLMAP, the newest first.
struct ColmapOption {
  std::vector<std::string> names;
  std::string value;
  bool needed = true;  // false: left out if this version has none of the names
};

class ColmapProgram {
 public:
  // `named`: a program in PATH, or a path. std::runtime_error, with what to do, if there is none, it is another
  // program, or its version is too old.
  explicit ColmapProgram(const std::string& named);

  const std::string& version() const { return version_; }  // "3.8"
  bool is_newer_than_tried() const { return newer_; }
  bool uses_cuda() const { return cuda_; }
  // Runs a command into a new log. Returns whether it succeeded. std::runtime_error with the log's last lines and path
  // if it failed, unless `may_fail` accepts its output; Interrupted.
  bool run(const std::string& name, const std::vector<ColmapOption>& options, const std::filesystem::path& log,
           const std::function<void(const std::string&)>& on_line,
           const std::function<bool(const std::string&)>& may_fail = {});

 private:
  std::vector<std::string> arguments(const std::string& name, const std::vector<ColmapOption>& options);

  std::string program_, version_;
  bool newer_ = false, cuda_ = false;
  std::map<std::string, std::string> help_;  // by command
};

}  // namespace command
