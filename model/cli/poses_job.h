// Finds the cameras of pictures with COLMAP, step by step, in a folder of its own that it then puts in place.
#pragma once
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "colmap_program.h"
#include "command.h"
#include "poses_pictures.h"
#include "poses_work.h"

namespace command {

struct PosesOptions {
  Common common;
  std::string pictures, output, colmap = "colmap", matcher = "auto", vocabulary, lens = "radial", gpu = "auto";
  std::string mask_command;
  int frames = 0;  // 0: the default
  bool mask_features = false;
};

class PosesJob {
 public:
  // Everything that can be refused at once.
  explicit PosesJob(const PosesOptions& options);
  // Writes the folder and says what is in it. Returns the result for --json.
  nlohmann::ordered_json run();

 private:
  enum class Matcher { exhaustive, sequential, vocabulary };

  std::filesystem::path in_work(const char* name) const { return work_.folder() / name; }
  nlohmann::ordered_json request() const;
  void place_pictures();
  void make_masks();
  void choose_settings();
  void find_features();
  void extract(const std::vector<std::string>& names, const ColmapOption& camera, std::size_t done);
  void match();
  std::vector<ColmapOption> matcher_options() const;
  void find_cameras();
  nlohmann::ordered_json put_in_place();
  void tell(const nlohmann::ordered_json& result) const;

  const PosesOptions& o_;
  PictureSource source_;
  ColmapProgram colmap_;
  PosesWork work_;
  bool gpu_ = false;
  std::vector<std::string> names_;  // of the pictures in the folder of work
  std::vector<LensGroup> groups_;
  Matcher matcher_ = Matcher::exhaustive;
  std::string vocabulary_, camera_model_;
};

}  // namespace command
