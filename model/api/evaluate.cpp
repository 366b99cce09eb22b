// Evaluations of models on data sets.
#include "model/evaluate/evaluate.h"

#include <fmt/format.h>

#include <cmath>
#include <deque>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "model/api/cameras.h"
#include "model/api/dataset.h"
#include "model/api/device.h"
#include "model/api/drawing.h"
#include "model/api/input.h"
#include "model/api/model.h"
#include "model/api/scene.h"
#include "model/api/selected.h"
#include "model/api/share.h"
#include "model/evaluate/model_check.h"
#include "model/evaluate/scene_measure.h"
#include "model/io/picture/image_file.h"
#include "model/render/supersample.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

struct vsplat_evaluation_impl : vsplat::api::Counted {
  explicit vsplat_evaluation_impl(vsplat::Evaluation from) : evaluation(std::move(from)) {}
  const vsplat::Evaluation evaluation;
};

using namespace vsplat;
using namespace vsplat::api;

namespace {

Protocol protocol_of(const vsplat_protocol& protocol) {
  switch (value_of(protocol)) {
    case VSPLAT_PROTOCOL_KMEANS:
      return Protocol::kmeans;
    case VSPLAT_PROTOCOL_RANDOM10:
      return Protocol::random10;
  }
  fail(Status::usage, "options.protocol is {}, not a value of vsplat_protocol", value_of(protocol));
}

// LPIPS networks whose weight files are in the folder.
std::vector<Lpips> load_lpips(Context& ctx, const std::string& folder) {
  std::vector<Lpips> out;
  for (const LpipsNet net : {LpipsNet::alex, LpipsNet::vgg}) {
    const std::filesystem::path path = std::filesystem::path(folder) / fmt::format("{}.safetensors", name_of(net));
    std::error_code ignored;
    if (std::filesystem::exists(path, ignored)) out.emplace_back(ctx, path.string(), net);
  }
  if (out.empty())
    fail(Status::file, "{}: has neither alex.safetensors nor vgg.safetensors, the weights of LPIPS", folder);
  return out;
}

vsplat_scores scores_of(const Scores& from) {
  vsplat_scores out = VSPLAT_SCORES_INIT;
  out.psnr = from.psnr;
  out.psnr_coarse = from.psnr_coarse;
  out.ssim = from.ssim;
  out.psnr_white = from.psnr_white;
  out.psnr_nearest = from.psnr_nearest;
  out.selected = from.selected;
  out.lpips_alex = from.lpips_alex;
  out.lpips_vgg = from.lpips_vgg;
  out.pose_degrees = from.pose_degrees;
  out.pose_distance = from.pose_distance;
  out.ray_degrees = from.ray_degrees;
  out.ray_moment = from.ray_moment;
  out.gaussians = from.gaussians;
  out.seconds = from.seconds;
  return out;
}

std::string json_of(const ModelCheck& from, int image) {
  nlohmann::ordered_json out{{"object", from.object}, {"image", image}, {"views", nlohmann::ordered_json::array()}};
  for (const CheckedView& view : from.views)
    out["views"].push_back({{"name", view.name}, {"psnr", view.psnr}, {"psnr_nearest", view.psnr_nearest}});
  out["psnr"] = from.psnr;
  out["psnr_nearest"] = from.psnr_nearest;
  out["below_nearest"] = from.is_below_nearest();
  out["gaussians"] = from.gaussians;
  return out.dump(1);
}

}  // namespace

vsplat_status vsplat_evaluate(vsplat_device device, vsplat_model model, vsplat_dataset dataset,
                              const vsplat_evaluate_options* options, vsplat_evaluation* out_evaluation) {
  return guarded([&] {
    const DeviceUse use(device);
    need(model, "model");
    need(dataset, "dataset");
    need(out_evaluation, "out_evaluation");
    const vsplat_evaluate_options o = taken(options, VSPLAT_EVALUATE_OPTIONS_INIT, "options");
    EvaluateOptions how;
    if (o.picture_size < 0)
      fail(Status::usage, "{} is {}: a number of pixels, or 0 for the model's, is expected", Option::evaluate_size,
           o.picture_size);
    how.request = {protocol_of(o.protocol), o.seed,
                   o.picture_size,          o.view_count,
                   crop_of(o.crop),         placement_of(o.has_center != 0, o.center, o.scale, o.auto_frame != 0)};
    how.skip_bad = o.skip_bad != 0;
    how.sheet = o.sheet != 0;
    how.refine = o.refine != 0;
    if (o.ranks) how.ranks = &Ranks::world();
    how.pose_noise = o.pose_noise;
    how.pose_draws = o.pose_draws == 0 ? 1 : o.pose_draws;
    if (o.supersample > static_cast<uint64_t>(kMostSamples))
      fail(Status::usage,
           "{} is {}: 1 to {} samples along a pixel's edge, or 0 for as many as the model's size asks for",
           Option::evaluate_supersample, o.supersample, kMostSamples);
    how.supersample = static_cast<int>(o.supersample);
    how.planned_selected = selected_of(0, VSPLAT_ASSUME_SELECTED, config_of(model), "selected");
    if (o.progress)
      how.progress = [&o](const std::string& object, double done) {
        if (!o.progress(o.user, object.c_str(), done)) fail(Status::cancelled, "stopped before object {}", object);
      };
    if (o.on_object)
      how.on_object = [&o](const ObjectScores& object) {
        const vsplat_scores scores = scores_of(object.scores);
        o.on_object(o.user, object.name.c_str(), &scores);
      };
    // All devices, the call's first, with what each holds during the call.
    const std::vector<vsplat_device> devices =
        with_more(device, o.more_devices, o.num_more_devices, Option::evaluate_devices);
    std::deque<DeviceUse> uses;
    std::deque<std::vector<Lpips>> lpips;
    std::deque<std::shared_ptr<const Network>> networks;
    std::vector<Evaluating> workers;
    for (vsplat_device each : devices) {
      if (each != device) uses.emplace_back(each);
      each->residents->drop_idle(model);  // its objects may need all the memory
      lpips.push_back(o.lpips ? load_lpips(each->context, o.lpips) : std::vector<Lpips>());
      networks.push_back(each->residents->network(each->context, model));
      workers.push_back({each->context, *networks.back()});
      for (const Lpips& net : lpips.back()) workers.back().lpips.push_back(&net);
    }
    Evaluation made = evaluate(workers, dataset->data, how,
                               [&](std::size_t worker, const Error& error) { warn_of_loss(devices, worker, error); });
    *out_evaluation = std::make_unique<vsplat_evaluation_impl>(std::move(made)).release();
  });
}

void vsplat_evaluation_retain(vsplat_evaluation evaluation) { retain(evaluation); }
void vsplat_evaluation_release(vsplat_evaluation evaluation) { release(evaluation); }

vsplat_status vsplat_evaluation_count(vsplat_evaluation evaluation, size_t* out_objects, size_t* out_skipped) {
  return guarded([&] {
    need(evaluation, "evaluation");
    if (out_objects) *out_objects = evaluation->evaluation.objects.size();
    if (out_skipped) *out_skipped = evaluation->evaluation.skipped;
  });
}

vsplat_status vsplat_evaluation_get(vsplat_evaluation evaluation, size_t index, char** out_name,
                                    vsplat_scores* out_scores) {
  return guarded([&] {
    need(evaluation, "evaluation");
    const std::vector<ObjectScores>& objects = evaluation->evaluation.objects;
    if (index >= objects.size()) fail(Status::usage, "there is no object {}: {} in all", index, objects.size());
    if (out_scores) give(out_scores, scores_of(objects[index].scores), "out_scores");
    if (out_name) *out_name = new_text(objects[index].name);
  });
}

vsplat_status vsplat_evaluation_get_mean(vsplat_evaluation evaluation, vsplat_scores* out_scores) {
  return guarded([&] {
    need(evaluation, "evaluation");
    give(out_scores, scores_of(evaluation->evaluation.mean), "out_scores");
  });
}

vsplat_status vsplat_evaluation_save_sheet(vsplat_evaluation evaluation, const char* path) {
  return guarded([&] {
    need(evaluation, "evaluation");
    need(path, "path");
    if (evaluation->evaluation.sheet.empty()) fail(Status::usage, "this evaluation was made without a sheet");
    write_png(path, evaluation->evaluation.sheet);
  });
}

namespace {

std::vector<int> measured_views(const ViewSet& set, const vsplat_measure_options& o) {
  if (o.views) {
    need_array(o.views, o.num_views, "options.views");
    if (o.num_views == 0) fail(Status::usage, "options.num_views is 0: there is nothing to compare");
    for (std::size_t i = 0; i < o.num_views; ++i)
      if (o.views[i] < 0 || static_cast<std::size_t>(o.views[i]) >= set.views.size())
        fail(Status::usage, "options.views[{}] is {}: there are views 0 to {}", i, o.views[i], set.views.size() - 1);
    std::vector<std::string> names;
    for (std::size_t i = 0; i < o.num_views; ++i) names.push_back(fmt::format("@{}", o.views[i]));
    return listed_views(set, names, Option::views);  // which refuses those without a picture
  }
  if (o.cameras) fail(Status::usage, "options.cameras needs options.views");
  return listed_views(set, {}, Option::views);
}

vsplat_measured measured(const PictureScores& scores, int view) {
  vsplat_measured out = VSPLAT_MEASURED_INIT;
  out.view = view;
  out.psnr = scores.psnr, out.psnr_cc = scores.psnr_cc, out.ssim = scores.ssim;
  out.lpips_alex = scores.lpips_alex, out.lpips_vgg = scores.lpips_vgg;
  return out;
}

// Where view `i` of the request is drawn from.
Camera drawn_from(const vsplat_measure_options& o, std::size_t i, const ComparedPhotograph& given) {
  if (!o.cameras) return given.camera;
  const Camera out = camera_of(o.cameras[i], fmt::format("options.cameras[{}]", i).c_str());
  if (out.width != given.camera.width || out.height != given.camera.height)
    fail(Status::usage, "options.cameras[{}] is of {} x {} pixels, the photograph of {} x {}", i, out.width, out.height,
         given.camera.width, given.camera.height);
  return out;
}

}  // namespace

vsplat_status vsplat_scene_measure(vsplat_device device, vsplat_scene scene, vsplat_views views,
                                   const vsplat_measure_options* options, vsplat_measured* out_mean) {
  return guarded([&] {
    const DeviceUse use(device);
    need(scene, "scene");
    need(views, "views");
    require_output(out_mean, "out_mean");
    const vsplat_measure_options o = taken(options, VSPLAT_MEASURE_OPTIONS_INIT, "options");
    if (o.longest < 0) fail(Status::usage, "options.longest is {}: 0, or a number of pixels expected", o.longest);
    Photographs photographs = views->photographs;
    photographs.masks = masks_of(o.masks);
    photographs.invert_masks = o.invert_masks != 0;
    const std::shared_ptr<const Scene> drawn_scene = scene->now();
    vsplat_render_options render = VSPLAT_RENDER_OPTIONS_INIT;
    std::copy_n(o.background, 3, render.background);
    (void)options_of(render, *drawn_scene);  // checks the background
    const std::vector<int> wanted = measured_views(photographs.set, o);
    const std::vector<Lpips> nets = o.lpips ? load_lpips(device->context, o.lpips) : std::vector<Lpips>();
    std::vector<const Lpips*> lpips;
    lpips.reserve(nets.size());
    for (const Lpips& net : nets) lpips.push_back(&net);
    std::vector<PictureScores> all;
    for (std::size_t i = 0; i < wanted.size(); ++i) {
      const ComparedPhotograph given =
          compared_photograph(photographs, wanted[i], o.longest, {o.background[0], o.background[1], o.background[2]});
      const Camera camera = in_frame(*drawn_scene, drawn_from(o, i, given));
      const RenderOptions how = drawn_as(render, *drawn_scene, camera);
      Image drawn =
          render_picture(device->context, on_device(device, drawn_scene, drawn_pixels(camera, how)), camera, how)
              .colour;
      all.push_back(compare_drawing(device->context, drawn, given, lpips));
      vsplat_measured compared = measured(all.back(), wanted[i]);
      compared.width = drawn.width, compared.height = drawn.height;
      compared.drawn = drawn.data.data(), compared.given = given.picture.data.data();
      if (o.on_picture && !o.on_picture(o.user, &compared))
        fail(Status::cancelled, "stopped after {} of {} pictures", i + 1, wanted.size());
      if (std::isnan(compared.psnr))
        warn("{}: no pixel of it is inside its mask, so nothing can be measured on it: it is left out of the means",
             photographs.set.views[static_cast<std::size_t>(wanted[i])].name);
    }
    const PictureScores mean = mean_of(all);
    if (std::isnan(mean.psnr))
      fail(Status::input, "no pixel of the {} pictures is inside its mask, so nothing can be measured", all.size());
    give(out_mean, measured(mean, -1), "out_mean");
  });
}

vsplat_status vsplat_model_check(vsplat_device device, vsplat_model model, const vsplat_check_options* options,
                                 char** out_text) {
  return guarded([&] {
    const DeviceUse use(device);
    need(model, "model");
    need(out_text, "out_text");
    const vsplat_check_options o = taken(options, VSPLAT_CHECK_OPTIONS_INIT, "options");
    const AnyConfig config = config_of(model);
    ForwardOptions forward;
    forward.planned_selected = selected_of(0, VSPLAT_ASSUME_SELECTED, config, "selected");
    if (o.progress)
      forward.progress = [&o](const std::string& stage, double done) {
        if (!o.progress(o.user, stage.c_str(), done)) fail(Status::cancelled, "stopped before stage {}", stage);
      };
    const ModelCheck found = retry_with_memory_freed(device, model, [&] {
      const auto network = device->residents->network(device->context, model);
      return check_model(device->context, *network, forward);
    });
    *out_text = new_text(json_of(found, config.image()));
  });
}
