// Training.
#include <algorithm>
#include <deque>
#include <optional>

#include "model/api/device.h"
#include "model/api/plan.h"
#include "model/api/selected.h"
#include "model/api/share.h"
#include "model/train/run_page.h"
#include "model/train/staged_training.h"
#include "model/train/train_ranks.h"
#include "runtime/fail.h"
#include "runtime/option.h"

using namespace vsplat;
using namespace vsplat::api;

namespace {

vsplat_train_progress progress_of(const TrainProgress& p) {
  const StepReport& r = p.report;
  vsplat_train_progress out{};
  out.size = sizeof out;
  out.step = r.step;
  out.steps = p.steps;
  out.learning_rate = r.lr;
  out.temperature = r.temperature;
  out.loss = r.loss;
  out.psnr = r.psnr;
  out.psnr_coarse = r.psnr_coarse;
  out.selected = r.selected;
  out.gradient_norm = r.gradient_norm;
  out.most_selected = static_cast<uint64_t>(r.most_selected);
  out.most_intersections = r.intersections;
  out.seconds = p.seconds;
  out.objects_per_second = p.objects_per_second;
  out.seconds_left = p.seconds_left;
  return out;
}

std::optional<std::uint64_t> known(uint64_t intersections) {
  return intersections > 0 ? std::optional<std::uint64_t>(intersections) : std::nullopt;
}

// Frees what inference left on the device.
void clear(vsplat_device device) {
  device->residents->drop_idle();
  device->scene.reset();
  device->scene_key.reset();
  device->context.memory().trim();
}

// The data sets beside procedural objects. Fails if the options do not match the share of procedural objects.
DataSet data_of(const vsplat_train_options& o, const std::vector<TrainConfig>& stages) {
  const auto any = [&](const auto& of) { return std::any_of(stages.begin(), stages.end(), of); };
  need_array(o.data, o.num_data, "options.data");
  if (o.num_data == 0 && any([](const TrainConfig& stage) { return stage.procedural < 1; }))
    fail(Status::usage, "no {}: a data set is needed unless the configuration's procedural is 1", Option::data);
  if (o.textures && !any([](const TrainConfig& stage) { return stage.procedural > 0 || stage.rooms > 0; }))
    fail(Status::usage,
         "{} changes nothing if the configuration's procedural and rooms are 0: no procedural object and no room is "
         "drawn",
         Option::textures);
  if (o.num_data == 0) return {};
  std::vector<std::string> out;
  for (size_t i = 0; i < o.num_data; ++i) {
    need(o.data[i], "a path of options.data");
    out.emplace_back(o.data[i]);
  }
  return open_data_set(out);
}

// Options for a stage; `o` must outlive the result.
TrainOptions options_from(const vsplat_train_options& o, const AnyConfig& model) {
  TrainOptions t;
  t.output = o.output;
  if (o.init) t.init = o.init;
  t.resume = o.resume != 0;
  if (o.num_extend > 0) {
    need_array(o.extend, o.num_extend, "options.extend");
    t.extend.assign(o.extend, o.extend + o.num_extend);
  }
  t.skip_bad = o.skip_bad != 0;
  if (o.textures) t.textures = o.textures;
  if (o.on_progress)
    t.on_progress = [&o](const TrainProgress& p) {
      const vsplat_train_progress progress = progress_of(p);
      o.on_progress(o.user, &progress);
    };
  if (o.on_message) t.on_message = [&o](const std::string& text) { o.on_message(o.user, text.c_str()); };
  if (o.go_on) t.stop = [&o] { return o.go_on(o.user) == 0; };
  if (o.selection) t.selection = o.selection;
  t.planned_selected = selected_of(o.assume_selected, VSPLAT_TRAIN_ASSUME_SELECTED, model, "options.assume_selected");
  t.planned_in_sheet = selected_of(0, VSPLAT_ASSUME_SELECTED, model, "options.assume_selected");
  t.assumed_intersections = known(o.assume_intersections);
  return t;
}

// Host memory: what a checkpoint holds while it is written (the weights, their average and the optimiser's two
// moments), and the views of two objects, the one in use and the next. Decoded pictures are cached in addition while
// memory allows.
double host_bytes(const char* config) {
  double most = 0;
  for (const TrainConfig& stage : train_stages_from_json(config)) {
    const double pixels = stage.model.image(), count = static_cast<double>(parameter_count(stage.model));
    const double views = static_cast<double>(stage.batch * (stage.inputs_max + stage.novel));
    most = std::max(most, (4 * count + 2 * views * 3 * pixels * pixels) * sizeof(float));
  }
  return most;
}

// Plans the stage that needs the most memory. Stages that differ only in what needs no memory are planned once.
Trainer::Plan plan_of_stages(Context& ctx, const char* config, const vsplat_train_plan_options& o) {
  std::optional<Trainer::Plan> most;
  std::vector<TrainConfig> planned;
  for (const TrainConfig& stage : train_stages_from_json(config)) {
    TrainConfig alike = stage;
    alike.schedule = {}, alike.seed = 0;
    const long last = total_steps(stage.schedule);  // its loss is planned
    alike.fine_after = last > stage.fine_after ? 0 : 1;
    alike.surface_after = last > stage.surface_after ? 0 : 1;
    if (std::find(planned.begin(), planned.end(), alike) != planned.end()) continue;
    planned.push_back(std::move(alike));
    TrainPlanOptions p;
    if (o.selection) p.selection = o.selection;
    p.selected = selected_of(o.selected, VSPLAT_TRAIN_ASSUME_SELECTED, stage.model, "options.selected");
    p.intersections = known(o.intersections);
    p.bound = o.bound != 0;
    Trainer::Plan plan = plan_train(ctx, stage, p);
    if (!most || plan.peak > most->peak) most = std::move(plan);
  }
  return std::move(*most);
}

}  // namespace

vsplat_status vsplat_train(vsplat_device device, const char* config, const vsplat_train_options* options,
                           vsplat_train_result* out_result) {
  return guarded([&] {
    const DeviceUse use(device);
    need(config, "config");
    need(options, "options");
    const vsplat_train_options o = taken(options, VSPLAT_TRAIN_OPTIONS_INIT, "options");
    need(o.output, "options.output");
    if (out_result) check_size(*out_result, "out_result");
    const std::vector<TrainConfig> stages = train_stages_from_json(config);
    const std::vector<vsplat_device> devices =
        with_more(device, o.more_devices, o.num_more_devices, Option::train_devices);
    std::deque<DeviceUse> uses;
    for (std::size_t i = 1; i < devices.size(); ++i) uses.emplace_back(devices[i]);
    const auto options_of = [&](const TrainConfig& stage) {
      TrainOptions out = options_from(o, stage.model);
      for (std::size_t i = 1; i < devices.size(); ++i) out.helpers.push_back(&devices[i]->context);
      return out;
    };
    for (const TrainConfig& stage : stages) options_of(stage);  // checks every stage before anything is done
    Ranks* ranks = o.ranks ? &Ranks::world() : nullptr;
    std::optional<RankLeader> leader;  // from here on the other ranks follow
    if (ranks && ranks->count() > 1 && ranks->rank() == 0) leader.emplace(*ranks);
    const DataSet data = data_of(o, stages);
    for (vsplat_device each : devices) clear(each);
    TrainResult result;
    if (ranks && ranks->rank() > 0)
      follow(device->context, data, options_of, *ranks);
    else
      result = train_stages(device->context, stages, data, [&](const TrainConfig& stage) {
        TrainOptions of_stage = options_of(stage);
        of_stage.leader = leader ? &*leader : nullptr;
        return of_stage;
      });
    vsplat_train_result out = VSPLAT_TRAIN_RESULT_INIT;
    out.step = result.step;
    out.stopped = result.stopped ? 1 : 0;
    out.bad = static_cast<uint64_t>(result.bad);
    out.peak = result.peak;
    if (out_result) give(out_result, out, "out_result");
  });
}

vsplat_status vsplat_train_plan(vsplat_device device, const char* config, const vsplat_train_plan_options* options,
                                vsplat_plan* out_plan) {
  return guarded([&] {
    const DeviceUse use(device);
    need(config, "config");
    const vsplat_train_plan_options o = taken(options, VSPLAT_TRAIN_PLAN_OPTIONS_INIT, "options");
    require_output(out_plan, "out_plan");
    clear(device);
    const Trainer::Plan plan = plan_of_stages(device->context, config, o);
    give(out_plan, plan_of(device->context, plan.stages, plan.peak, plan.fits, host_bytes(config)), "out_plan");
  });
}

vsplat_status vsplat_train_report(const char* const* runs, size_t num_runs, const char* path) {
  return guarded([&] {
    need_array(runs, num_runs, "runs");
    need(path, "path");
    std::vector<std::string> folders;
    for (size_t i = 0; i < num_runs; ++i) {
      need(runs[i], "a path of runs");
      folders.emplace_back(runs[i]);
    }
    write_report(folders, path);
  });
}

vsplat_status vsplat_train_config(const char* config, char** out_text) {
  return guarded([&] {
    need(out_text, "out_text");
    *out_text = new_text(config ? to_json(train_stages_from_json(config)) : to_json(TrainConfig()));
  });
}
