#include "model/train/staged_training.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "model/train/beginning.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/files/folder_lock.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

// Whether the stage has done its last step; errors as those of begin().
bool is_done(const TrainConfig& config, const TrainOptions& options) {
  if (!options.resume || !fs::exists(options.output)) return false;
  const Checkpoint found = begin(config, {options.output, "", true, {}}).checkpoint;
  return found.step > 0 && found.step == total_steps(found.config.schedule);
}

void write_configuration(const std::string& run, const std::vector<TrainConfig>& stages) {
  std::error_code problem;
  fs::create_directories(run, problem);
  if (problem) fail(Status::file, "{}: cannot be made: {}", run, problem.message());
  const std::string text = to_json(stages);
  write_file((fs::path(run) / "config.json").string(), text.data(), text.size());
}

// Checks all stages before the first is trained: a later one may not be able to start from its predecessor.
void check_models(const std::vector<TrainConfig>& stages) {
  for (std::size_t i = 1; i < stages.size(); ++i) try {
      check_model_fits(stages[i - 1].model, stages[i]);
    } catch (const Error& e) {
      fail(e.status(), "stage {}: its model is not that of stage {}: {}", i + 1, i, e.what());
    }
}

}  // namespace

std::string stage_folder(const std::string& run, std::size_t i, std::size_t stages) {
  return stages == 1 ? run : (fs::path(run) / fmt::format("stage-{}", i + 1)).string();
}

TrainResult train_stages(Context& ctx, const std::vector<TrainConfig>& stages, const DataSet& data,
                         const std::function<TrainOptions(const TrainConfig&)>& options) {
  if (stages.empty()) fail(Status::usage, "a training without a stage");
  const FolderLock lock(options(stages.front()).output);
  if (stages.size() == 1) return train(ctx, stages.front(), data, options(stages.front()));
  check_models(stages);
  TrainResult result;
  std::string before;
  for (std::size_t i = 0; i < stages.size(); ++i) {
    TrainOptions o = options(stages[i]);
    const std::string run = o.output;
    o.output = stage_folder(run, i, stages.size());
    o.run = run;
    const bool last = i + 1 == stages.size();
    if (i > 0) o.init = before;
    if (!last) o.extend.clear();
    before = (fs::path(o.output) / "model.safetensors").string();
    if (!last && is_done(stages[i], o)) {
      if (o.on_message) o.on_message(fmt::format("stage {} of {} is done: {}", i + 1, stages.size(), o.output));
      continue;
    }
    if (i == 0) write_configuration(run, stages);
    if (o.on_message) o.on_message(fmt::format("stage {} of {}: {}", i + 1, stages.size(), o.output));
    const TrainResult stage = train(ctx, stages[i], data, o);
    ctx.memory().trim();
    result = {stage.step, stage.stopped, (fs::path(run) / "model.safetensors").string(), result.bad + stage.bad,
              std::max(result.peak, stage.peak)};
    const std::vector<unsigned char> model = read_file(stage.model);
    write_file(result.model, model.data(), model.size());
    if (stage.stopped) break;
  }
  return result;
}

}  // namespace vsplat
