// The folder in which `vsplat poses` works, beside the one that it writes. What is finished stays in it when the
// command is interrupted or fails, so that the same command goes on from there.
#pragma once
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "command.h"
#include "runtime/system/system.h"

namespace command {

class PosesWork {
 public:
  // std::runtime_error if `output` exists, unless it is an empty folder, or `overwrite` and one that an earlier run
  // wrote.
  PosesWork(const std::string& output, bool overwrite);

  // Makes the folder, or takes over that of an earlier run of the same `request`; another request's is emptied.
  // std::runtime_error if another process works in it.
  void open(const Common& common, const nlohmann::ordered_json& request);

  const std::filesystem::path& folder() const { return folder_; }
  // Whether a step was finished, by this run or by an earlier one.
  bool is_done(const std::string& step) const;
  void finish(const std::string& step);
  // A name for a new log.
  std::filesystem::path new_log(const std::string& name) const;
  // The logs of that name, the oldest first.
  std::vector<std::filesystem::path> logs(const std::string& name) const;

  // The folder as it will be at `output`. Call publish() once all is in it.
  std::filesystem::path result() const { return folder_ / "result"; }
  void publish();

 private:
  std::filesystem::path output_, folder_;
  vsplat::sys::Handle lock_;
  nlohmann::ordered_json state_;
};

}  // namespace command
