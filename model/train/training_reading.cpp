#include "model/train/training_reading.h"

#include "model/io/archive/selection_file.h"
#include "runtime/fail.h"

namespace vsplat {

std::optional<std::vector<int>> forced_selection(const TrainConfig& config, const std::string& selection) {
  if (selection.empty()) return std::nullopt;
  if (!config.model.as<Config>())
    fail(Status::usage, "{}: a list of voxels, which {} does not take", selection, config.model.network());
  return read_selection(selection, config.model.selectable());
}

long planned_of(const std::optional<std::vector<int>>& voxels, long planned) {
  return voxels ? static_cast<long>(voxels->size()) : planned;
}

TrainingOptions training_reading(const TrainConfig& config, const TrainOptions& options) {
  TrainingOptions out;
  out.image = config.model.image();
  out.rebase = config.model.taken().rebase;
  out.seed = config.seed;
  out.batch = static_cast<int>(config.batch * config.accumulate);
  out.min_inputs = static_cast<int>(config.inputs_min);
  out.max_inputs = static_cast<int>(config.inputs_max);
  out.first_listed = config.first_listed;
  out.novel = static_cast<int>(config.novel);
  out.random_background = config.random_background;
  out.alpha = config.alpha_weight > 0;
  out.crop = crop_from_name(config.crop);
  out.turn_degrees = config.turn_degrees;
  out.min_cube = config.cube_min;
  out.max_cube = config.cube_max;
  out.mirror = config.mirror;
  out.shuffle_channels = config.shuffle_channels;
  out.rooms = config.rooms;
  out.procedural = config.procedural;
  out.textures = config.procedural > 0 || config.rooms > 0 ? options.textures : "";
  out.cache_bytes = static_cast<std::size_t>(config.cache_gib * static_cast<double>(1ull << 30));
  out.skip_bad = options.skip_bad;
  return out;
}

}  // namespace vsplat
