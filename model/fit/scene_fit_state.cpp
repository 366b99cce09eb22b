// The checkpoint of a fit in progress.
#include <fmt/format.h>

#include <cstdio>

#include "model/base/rng.h"
#include "model/fit/fit_checkpoint.h"
#include "model/fit/scene_fit_impl.h"
#include "runtime/fail.h"
#include "runtime/files/safetensors.h"
#include "runtime/tuning/held_tuning.h"

namespace vsplat {
namespace {

Gaussians best_in(const FitCheckpoint& from) {
  Gaussians out;
  out.sh_degree = static_cast<int>(whole_number(from, "best_degree"));
  if (out.sh_degree > 3) fail(Status::format, "a fit's state has best_degree {}, 0 to 3 expected", out.sh_degree);
  out.count = tensor_of(from.tensors, "best.opacities").data.size();
  const auto take = [&](const std::string& name, std::size_t each) {
    const FitTensor& tensor = tensor_of(from.tensors, name);
    if (tensor.data.size() != each * out.count)
      fail(Status::format, "a fit's state has {} for {}, {} of {} Gaussians expected", text_of(tensor.shape), name,
           each * out.count, out.count);
    return tensor.data;
  };
  out.means = take("best.means", 3);
  out.scales = take("best.scales", 3);
  out.quats = take("best.quats", 4);
  out.opacities = take("best.opacities", 1);
  out.sh = take("best.sh", 3 * out.sh_count());
  return out;
}

}  // namespace

// Identifies the request: everything that the result's bits depend on, except the pixels.
std::string SceneFit::Impl::text_of_request() const {
  const FitRequest& r = request;
  std::string out = fmt::format(
      "recipe 6 steps {} max_gaussians {} degree {} longest {} freeze {}{}{}{}{} poses {} exposure {} density {} "
      "consolidate {} "
      "seed {} whole {} quality {} centre {} {} {} edge {}",
      r.steps, r.max_gaussians, r.degree.value_or(-1), r.longest, r.freeze.means, r.freeze.scales, r.freeze.rotations,
      r.freeze.opacities, r.freeze.sh, r.poses, r.exposure, static_cast<int>(r.density), exact_text(r.consolidate),
      r.seed, r.whole, static_cast<int>(r.quality), exact_text(given.placement.centre.x()),
      exact_text(given.placement.centre.y()), exact_text(given.placement.centre.z()), exact_text(given.placement.edge));
  if (r.background.kind != FitBackground::Kind::automatic)
    out += fmt::format(" background {} {} {} {}", static_cast<int>(r.background.kind),
                       exact_text(static_cast<double>(r.background.colour[0])),
                       exact_text(static_cast<double>(r.background.colour[1])),
                       exact_text(static_cast<double>(r.background.colour[2])));
  if (r.depth_weight > 0)
    out += fmt::format(" depth {} weight {}", r.depth, exact_text(static_cast<double>(r.depth_weight)));
  if (photographs.masks != MaskUse::object || photographs.invert_masks)
    out += fmt::format(" masks {} {}", static_cast<int>(photographs.masks), photographs.invert_masks);
  for (const Phase& each : phases) {
    out += " |";
    for (const int view : each.views)
      out += fmt::format(" {}", photographs.set.views[static_cast<std::size_t>(view)].name);
    out += " measured on";
    for (const int view : each.held_out)
      out += fmt::format(" {}", photographs.set.views[static_cast<std::size_t>(view)].name);
  }
  const Scene start = given.make(phases.back().views);
  if (start.antialias) out += " | antialias";
  out += " | near " + exact_text(static_cast<double>(start.near));
  if (!start.offset.isZero(0))
    out += fmt::format(" | about {} {} {}", exact_text(start.offset.x()), exact_text(start.offset.y()),
                       exact_text(start.offset.z()));
  std::uint32_t sum = stream_of("");
  for (const std::vector<float>* values : {&start.gaussians.means, &start.gaussians.scales, &start.gaussians.quats,
                                           &start.gaussians.opacities, &start.gaussians.sh})
    sum = sum * 31 + stream_of({reinterpret_cast<const char*>(values->data()), values->size() * sizeof(float)});
  return out + fmt::format(" | start of {} Gaussians, {:08x}", start.gaussians.count, sum);
}

void SceneFit::Impl::save() const {
  FitCheckpoint out;
  out.request = request_text;
  out.tensors = fitter->state();
  const auto keep = [&](const char* name, const Shape& shape, const std::vector<float>& data) {
    out.tensors[std::string("best.") + name] = {shape, data};
  };
  if (best) {
    const auto n = static_cast<long>(best->count);
    keep("means", {n, 3}, best->means);
    keep("scales", {n, 3}, best->scales);
    keep("quats", {n, 4}, best->quats);
    keep("opacities", {n}, best->opacities);
    keep("sh", {n, static_cast<long>(best->sh_count()), 3}, best->sh);
    out.state["best_degree"] = std::to_string(best->sh_degree);
  }
  hold_tuning(ctx, out.state);
  out.state["grows_to"] = std::to_string(grows_to);
  out.state["pairs"] = std::to_string(pairs);
  out.state["phase"] = std::to_string(phase);
  out.state["steps"] = std::to_string(fitter->steps_done());
  out.state["phase_steps"] = std::to_string(phase_steps);
  out.state["best_steps"] = std::to_string(best_steps);
  out.state["steps_in_all"] = std::to_string(steps_in_all);
  out.state["seconds"] = exact_text(seconds);
  out.state["phase_began"] = exact_text(phase_began);
  out.state["last_psnr"] = exact_text(last_psnr);
  out.state["falls"] = std::to_string(falls);
  out.state["replaced_after"] = std::to_string(fitter->replaced_after());
  out.state["consolidated_after"] = std::to_string(consolidated_after);
  out.state["pruned"] = pruned ? "1" : "0";
  for (const auto& [at, sum] : curve) {
    const std::string name = fmt::format("curve.{}", at);
    out.state[name + ".psnr"] = exact_text(sum.psnr);
    out.state[name + ".ssim"] = exact_text(sum.ssim);
    out.state[name + ".pictures"] = std::to_string(sum.pictures);
  }
  for (const auto& [view, pose] : poses) out.state[fmt::format("pose.{}", view)] = pose.text();
  for (const auto& [view, exposure] : exposures) put(ctx, exposure, fmt::format("exposure.{}", view), out);
  save_fit_checkpoint(request.checkpoint, out);
}

// Restores the position within the fit.
void SceneFit::Impl::read_place(const FitCheckpoint& from) {
  phase = static_cast<std::size_t>(whole_number(from, "phase"));
  if (phase >= phases.size())
    fail(Status::format, "a fit's state is of phase {}, of which there are {}", phase, phases.size());
  grows_to = whole_number(from, "grows_to");
  pairs = whole_number(from, "pairs");
  for (const auto& [name, text] : from.state) {
    long at = 0;
    if (std::sscanf(name.c_str(), "curve.%ld.psnr", &at) != 1 || !name.ends_with(".psnr")) continue;
    const std::string stem = name.substr(0, name.size() - 5);
    curve[at] = {number(from, stem + ".psnr"), number(from, stem + ".ssim"),
                 static_cast<int>(whole_number(from, stem + ".pictures"))};
  }
  if (curve.count(0) == 0 && !phases[phase].held_out.empty())
    fail(Status::format, "a fit's state has no curve.0.psnr: how good the start was");
}

// Restores the results of the current phase.
void SceneFit::Impl::read_progress(const FitCheckpoint& from) {
  phase_steps = whole_number(from, "phase_steps");
  fitter->restore(from.tensors, whole_number(from, "steps"), whole_number(from, "replaced_after"));
  consolidated_after = whole_number(from, "consolidated_after");
  pruned = whole_number(from, "pruned") != 0;
  best_steps = whole_number(from, "best_steps");
  steps_in_all = whole_number(from, "steps_in_all");
  seconds = number(from, "seconds");
  phase_began = from.state.count("phase_began") > 0 ? number(from, "phase_began") : seconds;
  last_psnr = number(from, "last_psnr");
  falls = from.state.count("falls") > 0 ? static_cast<int>(whole_number(from, "falls")) : 0;
  if (from.state.count("best_degree") > 0) best = best_in(from);
  for (const int view : phases[phase].views) {
    const std::string pose = fmt::format("pose.{}", view), exposure = fmt::format("exposure.{}", view);
    if (from.state.count(pose) > 0) poses.emplace(view, PoseCorrection::from_text(from.state.at(pose)));
    if (from.state.count(exposure + ".steps") > 0)
      get(ctx, exposures.try_emplace(view, make_exposure(ctx)).first->second, exposure, from);
  }
}

void SceneFit::Impl::go_on(const FitCheckpoint& from) {
  const auto named = [&](void (Impl::*read)(const FitCheckpoint&)) {
    try {
      (this->*read)(from);
    } catch (const Error& e) {
      if (e.status() != Status::format) throw;
      fail(Status::format, "{}: {}", fit_checkpoint_path(request.checkpoint), e.what());
    }
  };
  refuse_other_tuning(ctx, from.state, fit_checkpoint_path(request.checkpoint));
  named(&Impl::read_place);
  const std::map<long, Measured> curve_before = curve;
  resuming = true;
  begin_phase();
  resuming = false;
  curve = curve_before;
  named(&Impl::read_progress);
  if (fitter->steps_done() >= phase_steps) end_phase();
}

}  // namespace vsplat
