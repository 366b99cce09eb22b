#include "model/evaluate/evaluator.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "model/base/pose_noise.h"
#include "model/base/scene.h"
#include "model/fit/scene_fit.h"
#include "model/io/picture/contact_sheet.h"
#include "model/metrics/metrics.h"
#include "model/reconstruct/inputs_fit.h"
#include "model/reconstruct/passes.h"
#include "model/reconstruct/reconstruct.h"
#include "model/render/render.h"
#include "model/render/supersample.h"
#include "runtime/fail.h"
#include "runtime/option.h"

namespace vsplat {
namespace {

constexpr std::array<float, 3> kWhite{1, 1, 1};
constexpr int kSmallestSize = 11;  // a window of SSIM
constexpr int kLargestSize = 4096;
constexpr double Scores::*kNumbers[] = {
    &Scores::psnr,        &Scores::psnr_coarse, &Scores::ssim,      &Scores::psnr_white,   &Scores::psnr_nearest,
    &Scores::selected,    &Scores::lpips_alex,  &Scores::lpips_vgg, &Scores::pose_degrees, &Scores::pose_distance,
    &Scores::ray_degrees, &Scores::ray_moment,  &Scores::gaussians, &Scores::seconds};

// Share of the compared pixels that photographs show, 0 to 1: elsewhere pictures are equal.
double share_shown(const EvaluationObject& object) {
  double sum = 0, all = 0;
  for (const Image& shown : object.shown) {
    const double pixels = static_cast<double>(object.compared_size) * object.compared_size;
    all += pixels;
    sum += shown.empty() ? pixels : std::accumulate(shown.data.begin(), shown.data.end(), 0.0);
  }
  return sum / all;
}

}  // namespace

Scores::Scores()
    : lpips_alex(std::numeric_limits<double>::quiet_NaN()),
      lpips_vgg(lpips_alex),
      pose_degrees(lpips_alex),
      pose_distance(lpips_alex),
      ray_degrees(lpips_alex),
      ray_moment(lpips_alex) {}

Scores mean_of(const std::vector<ObjectScores>& objects) {
  Scores out;
  for (double Scores::*const number : kNumbers) {
    out.*number = 0;
    for (const ObjectScores& object : objects) out.*number += object.scores.*number;
    out.*number /= static_cast<double>(objects.size());
  }
  return out;
}

void Evaluator::check() const {
  if (options_.request.compared_size > 0 && (compared_size() < kSmallestSize || compared_size() > kLargestSize))
    fail(Status::usage, "{} is {}: pictures that are compared have {} to {} pixels an edge", Option::evaluate_size,
         compared_size(), kSmallestSize, kLargestSize);
  if (const int most = config_.taken().most; options_.request.inputs < 0 || options_.request.inputs > most)
    fail(Status::usage, "{} is {}: {} takes 1 to {}", Option::evaluate_view_count, options_.request.inputs,
         config_.network(), most);
  if (!(options_.pose_noise >= 0 && options_.pose_noise <= 1))
    fail(Status::usage, "{} is {}: 0 to 1 expected", Option::pose_noise, options_.pose_noise);
  if (options_.pose_draws < 1 || options_.pose_draws > 1000)
    fail(Status::usage, "{} is {}: 1 to 1000 expected", Option::pose_draws, options_.pose_draws);
  if (options_.pose_noise > 0 && options_.refine)
    fail(Status::usage, "{} is not measured under {}: the fit uses the listed poses", Option::evaluate_fit,
         Option::pose_noise);
  for (const Lpips* lpips : lpips_)
    if (lpips->smallest() > compared_size())
      fail(Status::usage, "LPIPS ({}) needs pictures of at least {} pixels, those compared have {}",
           name_of(lpips->net()), lpips->smallest(), compared_size());
}

Strip Evaluator::render_all(const DeviceGaussians& gaussians, const EvaluationObject& object, float near,
                            const std::optional<std::array<float, 3>>& mirror,
                            const std::optional<Detail>& detail) const {
  RenderOptions options = network_.drawing();
  options.background = kWhite;
  options.near = near;
  options.mirror = mirror;
  Strip out(compared_size(), object.novel());
  for (std::size_t i = 0; i < object.novel(); ++i) {
    const Camera& camera = object.cameras[object.inputs + i];
    options.supersample = options_.supersample > 0 ? options_.supersample : detail ? samples_for(*detail, camera) : 1;
    out.put(i, render_picture(ctx_, gaussians, camera, options).colour);
    out.leave_out(i, object.shown[i]);
  }
  return out;
}

// Reconstructs from those inputs that are among `views`, in the user's world.
Scene Evaluator::reconstructed(const EvaluationObject& object, const std::vector<int>& views) const {
  std::vector<PreparedView> prepared;
  for (std::size_t i = 0; i < object.inputs; ++i)
    if (std::find(views.begin(), views.end(), object.input_views[i]) != views.end())
      prepared.push_back({object.pictures[i], to_frame(object.cameras[i], object.to_world.inverse()), object.alphas[i],
                          object.masked[i]});
  ReconstructOptions options;
  options.forward.planned_selected = options_.planned_selected;
  return reconstruct(ctx_, network_, prepared, object.framed.placement, options).scene;
}

// Fits the scene to the inputs only: the compared views are not used.
Strip Evaluator::render_refined(const EvaluationObject& object) const {
  FitRequest request;
  for (const int view : object.input_views) request.names.push_back(fmt::format("@{}", view));
  const auto make = [&](const std::vector<int>& views) { return reconstructed(object, views); };
  const Predicted predicted = config_.taken().fit_epochs > 0 ? Predicted::fitted : Predicted::yes;
  SceneFit fit(ctx_, object.framed.photographs, {object.framed.placement, make, true, predicted}, request);
  while (fit.step()) {
  }
  Scene scene = fit.result().scene;
  transform(scene, object.to_world.inverse());
  return render_all(upload(ctx_, scene.gaussians), object, scene.near, scene.mirror, {});
}

// Fits a level to the inputs, as a reconstruction does the last one.
Gaussians Evaluator::fitted(const Gaussians& level, const EvaluationObject& object,
                            const std::vector<Camera>& cameras) const {
  const int epochs = config_.taken().fit_epochs;
  if (epochs == 0) return level;
  std::vector<FitPicture> pictures;
  for (std::size_t i = 0; i < object.inputs; ++i)
    pictures.push_back(fit_picture(object.pictures[i], object.alphas[i], object.masked[i], cameras[i]));
  return fitted_to_inputs(ctx_, level, pictures, {epochs, network_.drawing().mirror, {}});
}

Evaluator::Drawn Evaluator::draw(const EvaluationObject& object, int noise_draw) const {
  std::vector<float> pictures;
  for (std::size_t i = 0; i < object.inputs; ++i)
    pictures.insert(pictures.end(), object.pictures[i].data.begin(), object.pictures[i].data.end());
  const std::vector<Camera> listed(object.cameras.begin(),
                                   object.cameras.begin() + static_cast<std::ptrdiff_t>(object.inputs));
  const bool noisy = options_.pose_noise > 0;
  const std::vector<Camera> cameras = noisy ? noisy_cameras(listed, options_.pose_noise, options_.request.seed,
                                                            static_cast<std::uint32_t>(noise_draw), object.name)
                                            : listed;
  ForwardOptions forward;
  forward.planned_selected = options_.planned_selected;
  ctx_.finish();
  const auto begun = std::chrono::steady_clock::now();
  const TakenViews taken = config_.taken();
  Passes passes = forward_passes(ctx_, network_, pictures, cameras, {taken.passes, taken.merge_cell, true}, forward);
  const Network::Result& result = passes.first;
  Gaussians& last = config_.has_fine() ? passes.final : passes.coarse;
  last = fitted(last, object, cameras);
  ctx_.finish();
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begun;
  if (config_.has_fine()) passes.coarse = fitted(passes.coarse, object, cameras);
  const double selected = static_cast<double>(result.voxels.size()) / std::pow(result.volume, 3);
  Scores poses;
  poses.seconds = took.count();
  poses.gaussians = static_cast<double>(last.count);
  if (noisy) {
    const PoseErrors off = pose_errors(cameras, listed);
    poses.pose_degrees = off.degrees, poses.pose_distance = off.distance;
  }
  if (result.rays) {
    const Config& config = *config_.as<Config>();
    const RayErrors off = ray_errors(ctx_.read<float>(result.rays), patch_rays(listed, config.tokens(), config.patch));
    poses.ray_degrees = off.degrees, poses.ray_moment = off.moment;
  }
  Strip truth(compared_size(), object.novel());
  for (std::size_t i = 0; i < object.novel(); ++i) truth.put(i, object.pictures[object.inputs + i]);
  const std::optional<std::array<float, 3>> mirror = network_.drawing().mirror;
  const std::optional<Detail> detail = detail_of(listed, Eigen::Vector3d::Zero());
  const auto drawn = [&](const Gaussians& gaussians) {
    return render_all(upload(ctx_, gaussians), object, static_cast<float>(kNearInObject), mirror, detail);
  };
  const Strip coarse = drawn(passes.coarse);
  // Without a selected voxel there is nothing to fit.
  if (options_.refine && passes.final.count > 0) return {truth, coarse, render_refined(object), poses, selected};
  return {truth, coarse, config_.has_fine() ? drawn(passes.final) : coarse, poses, selected};
}

Scores Evaluator::score(const EvaluationObject& object) const {
  const int count = options_.pose_noise > 0 ? options_.pose_draws : 1;
  std::vector<ObjectScores> draws;
  draws.reserve(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) draws.push_back({object.name, score(object, i)});
  return mean_of(draws);
}

Scores Evaluator::score(const EvaluationObject& object, int noise_draw) const {
  const Drawn drawn = draw(object, noise_draw);
  const Image &truth = drawn.truth.image(), &result = drawn.result.image();
  Strip nearest(compared_size(), object.novel());
  for (std::size_t i = 0; i < object.novel(); ++i) {
    nearest.put(i, object.input_compared(object.nearest[i]));
    nearest.leave_out(i, object.shown[i]);
  }
  Scores out = drawn.poses;
  const double of_shown = 10 * std::log10(share_shown(object));
  out.psnr = psnr(result, truth) + of_shown;
  out.psnr_coarse = psnr(drawn.coarse.image(), truth) + of_shown;
  out.ssim = ssim(result, truth);
  out.psnr_white = psnr(Image(truth.width, truth.height, 3, 1.0f), truth) + of_shown;
  out.psnr_nearest = psnr(nearest.image(), truth) + of_shown;
  out.selected = drawn.selected;
  for (const Lpips* lpips : lpips_)
    (lpips->net() == LpipsNet::alex ? out.lpips_alex : out.lpips_vgg) = lpips->distance(ctx_, result, truth);
  return out;
}

Image Evaluator::sheet(const std::vector<const DataObject*>& objects) const {
  constexpr std::size_t kViews = 4;
  const Image blank(compared_size(), compared_size(), 3, ContactSheet::paper);
  // with their labels, at the first picture of each object
  std::array<std::vector<std::pair<Image, std::string>>, 4> rows;
  for (const DataObject* listed : objects) {
    std::vector<std::string> messages;
    const EvaluationObject object = load(*listed, messages, messages);
    const Drawn drawn = draw(object);
    for (std::size_t i = 0; i < kViews; ++i) {
      const auto label = [&](const std::string& text) { return i == 0 ? text : ""; };
      rows[0].emplace_back(i < object.inputs ? object.pictures[i] : blank, label(listed->name));
      std::size_t row = 0;
      const std::array<const char*, 3> names = {"truth", "coarse", "result"};
      for (const Strip* strip : {&drawn.truth, &drawn.coarse, &drawn.result}) {
        rows[row + 1].emplace_back(i < object.novel() ? strip->at(i) : blank, label(names[row]));
        ++row;
      }
    }
  }
  ContactSheet sheet({.cell = 256, .columns = static_cast<int>(rows[0].size()), .expected = 0});
  for (const auto& row : rows)
    for (const auto& [picture, label] : row) sheet.add(picture, label);
  return sheet.sheet();
}

std::vector<std::size_t> typical(const std::vector<ObjectScores>& objects) {
  std::vector<std::size_t> ranked(objects.size());
  for (std::size_t i = 0; i < ranked.size(); ++i) ranked[i] = i;
  std::stable_sort(ranked.begin(), ranked.end(),
                   [&](std::size_t a, std::size_t b) { return objects[a].scores.psnr > objects[b].scores.psnr; });
  std::vector<std::size_t> out = {ranked.front()};
  if (ranked.size() > 2) out.push_back(ranked[ranked.size() / 2]);
  if (ranked.size() > 1) out.push_back(ranked.back());
  return out;
}

}  // namespace vsplat
