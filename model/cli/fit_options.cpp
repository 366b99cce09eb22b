// From the options of a fit as given to those of the library.
#include <algorithm>
#include <array>
#include <string>

#include "arguments.h"
#include "fit_job.h"

namespace command {
namespace {

// A number from 1 up; `also` names what else is accepted.
std::int64_t count_of(const std::string& option, const std::string& text, const std::string& also) {
  const std::uint64_t value = is_digits(text) && text.size() < 11 ? std::stoull(text) : 0;
  if (value < 1 || value > INT32_MAX)
    throw UsageError(option + " is \"" + text + "\": " + also + "a whole number from 1 up expected");
  return static_cast<std::int64_t>(value);
}

std::uint32_t freeze_of(const std::string& text) {
  std::uint32_t out = 0;
  for (const std::string& name : list("--freeze", text)) {
    const std::uint32_t bit = name == "means"       ? VSPLAT_FREEZE_MEANS
                              : name == "scales"    ? VSPLAT_FREEZE_SCALES
                              : name == "rotations" ? VSPLAT_FREEZE_ROTATIONS
                              : name == "opacities" ? VSPLAT_FREEZE_OPACITIES
                              : name == "sh"        ? VSPLAT_FREEZE_SH
                                                    : 0;
    if (bit == 0)
      throw UsageError("--freeze is \"" + text + "\": of means,scales,rotations,opacities,sh expected, not " + name);
    out |= bit;
  }
  return out;
}

void set_background(vsplat_fit_options& options, const std::string& text) {
  if (text.empty() || text == "auto") return;
  options.background = text == "random" ? VSPLAT_BACKGROUND_RANDOM
                       : text == "sky"  ? VSPLAT_BACKGROUND_SKY
                                        : VSPLAT_BACKGROUND_COLOUR;
  if (options.background != VSPLAT_BACKGROUND_COLOUR) return;
  const std::array<float, 3> given = colour("--background", text);
  std::copy(given.begin(), given.end(), options.background_colour);
}

void set_depth(vsplat_fit_options& options, const FitOptions& o) {
  options.depth = o.depth == "metric"     ? VSPLAT_FIT_DEPTH_METRIC
                  : o.depth == "relative" ? VSPLAT_FIT_DEPTH_RELATIVE
                  : o.depth == "inverse"  ? VSPLAT_FIT_DEPTH_INVERSE
                  : o.depth == "points"   ? VSPLAT_FIT_DEPTH_POINTS
                                          : VSPLAT_FIT_DEPTH_NONE;  // already checked by CLI11
  if (o.depth_weight.empty()) return;
  if (options.depth == VSPLAT_FIT_DEPTH_NONE) throw UsageError("--depth-weight needs --depth");
  options.depth_weight =
      static_cast<float>(positive_number("--depth-weight", o.depth_weight, "weight of the depth's loss"));
}

}  // namespace

FitJob::FitJob(const FitOptions& o, const FitNames& names)
    : log_(o.log),
      sheet_(o.sheet),
      checkpoint_(o.checkpoint),
      page_path_(o.page),
      record_(o.record),
      live_port_(o.live) {
  options.poses = o.poses;
  options.exposure = o.exposure;
  options.antialias = o.antialias;
  set_background(options, o.background);
  if (o.masks == "ignore") options.masks = VSPLAT_MASKS_IGNORE;  // already checked by CLI11
  options.invert_masks = o.invert_masks;
  set_depth(options, o);
  options.checkpoint = checkpoint_.empty() ? nullptr : checkpoint_.c_str();
  options.resume = o.resume;
  if (o.resume && checkpoint_.empty()) throw UsageError("--resume needs --checkpoint, the folder of the state");
  if (!o.steps.empty() && o.steps != "auto") options.steps = count_of(names.steps, o.steps, "auto or ");
  if (!o.seconds.empty()) options.seconds = positive_number(names.time, o.seconds, "number of seconds");
  if (!o.max_gaussians.empty())
    options.max_gaussians = static_cast<std::uint64_t>(count_of("--max-gaussians", o.max_gaussians, ""));
  if (o.strategy == "error") options.density = VSPLAT_DENSITY_ERROR;  // already checked by CLI11
  if (!o.consolidate.empty()) {
    options.consolidate = positive_number("--consolidate", o.consolidate, "share of the Gaussians, 1 for all");
    if (options.consolidate > 1)
      throw UsageError("--consolidate is \"" + o.consolidate + "\": a share above 0 and at most 1 expected");
  }
  if (!o.sh.empty()) options.sh_degree = std::stoi(o.sh);  // already checked by CLI11
  if (!o.freeze.empty()) options.freeze = freeze_of(o.freeze);
  if (!o.seed.empty()) options.seed = seed_value("--seed", o.seed);
  options.quality = o.quality == "high"     ? VSPLAT_QUALITY_HIGH
                    : o.quality == "normal" ? VSPLAT_QUALITY_NORMAL
                                            : VSPLAT_QUALITY_DRAFT;
  if (o.size == "full")
    options.longest = 0;
  else if (!o.size.empty())
    options.longest = static_cast<std::int32_t>(count_of(names.size, o.size, "full or "));
  if (o.holdout == "none") {
    options.holdout = VSPLAT_HOLDOUT_NONE;
  } else if (is_digits(o.holdout)) {
    options.holdout = VSPLAT_HOLDOUT_COUNT;
    options.holdout_count = static_cast<std::int32_t>(count_of("--holdout", o.holdout, "auto, none, names or "));
  } else if (!o.holdout.empty() && o.holdout != "auto") {
    options.holdout = VSPLAT_HOLDOUT_NAMES;
    holdout_ = list("--holdout", o.holdout);
    for (const std::string& name : holdout_) holdout_pointers_.push_back(name.c_str());
    options.holdout_names = holdout_pointers_.data();
    options.num_holdout_names = holdout_pointers_.size();
  }
  need_ending(names.sheet, sheet_, ".png");
  need_ending("--log", log_, ".csv");
  need_ending("--page", page_path_, ".html");
}

}  // namespace command
