// Text formats: configurations and lists of voxels.
#include <algorithm>

#include "model/io/archive/selection_file.h"
#include "model/train/train_config.h"
#include "tests/fuzz/targets.h"

namespace vsplat::fuzz {

void train_config(std::string_view bytes) {
  try {
    const std::vector<TrainConfig> stages = train_stages_from_json(std::string(bytes));
    hold(!stages.empty() && stages.size() <= 100, "1 to 100 stages");
    for (const TrainConfig& stage : stages) check(stage, Status::internal);
    const std::string text = to_json(stages);
    hold(train_stages_from_json(text) == stages, "what is written is what was read");
    hold(to_json(train_stages_from_json(text)) == text, "and is written as before");
  } catch (const Error& e) {
    hold(e.status() == Status::format, "an error of what the text says");
    hold_message(e, "");
  }
}

void selection(std::string_view bytes) {
  static MemoryFile file;
  file.fill(bytes);
  constexpr long kVoxels = 64;
  try {
    const std::vector<int> voxels = read_selection(file.path(), kVoxels);
    hold(std::is_sorted(voxels.begin(), voxels.end()), "ascending");
    hold(std::adjacent_find(voxels.begin(), voxels.end()) == voxels.end(), "each once");
    hold(voxels.empty() || (voxels.front() >= 0 && voxels.back() < kVoxels), "in the volume");
  } catch (const Error& e) {
    hold_message(e, file.path());
  }
}

}  // namespace vsplat::fuzz
