// Fitting a scene to the user's pictures: what `vsplat fit` and `reconstruct --refine` share.
#pragma once
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "outputs.h"
#include "session.h"

namespace command {

// Options as given; "" if not given. `vsplat fit` has all of them.
struct FitOptions {
  std::string steps, size, sheet;
  std::string quality = "draft", seconds, max_gaussians, strategy, consolidate, holdout, sh, freeze, seed, log,
              checkpoint, background, masks;
  bool poses = false, exposure = false, resume = false, antialias = false, invert_masks = false;
};

// The options' names in messages.
struct FitNames {
  const char *steps = "--steps", *size = "--size", *sheet = "--sheet", *time = "--time";
};

class FitJob {
 public:
  // Reports every error of the request itself.
  explicit FitJob(const FitOptions& given, const FitNames& names = {});
  FitJob(const FitJob&) = delete;
  FitJob& operator=(const FitJob&) = delete;

  // The caller sets start, scene, model, input and names.
  vsplat_fit_options options = VSPLAT_FIT_OPTIONS_INIT;
  std::string from;  // the path of the views, for errors about them

  // `output`: the scene's file; poses are written beside it.
  void expect(Outputs& outputs, const std::string& output);
  // Runs to the end, or until the user interrupts: then the best scene so far is the result, and a message says so.
  // Calls `on_start` with the start scene before the first step.
  vsplat::Scene run(Session& session, const Common& common, const vsplat::Views& views, Outputs& outputs,
                    const std::function<void(const vsplat::Scene&)>& on_start = {});
  // The start scene; valid after run().
  const vsplat::Scene& start() const { return start_; }
  // Prints the result, and warnings if any.
  void summarise(const Common& common) const;
  // Adds the fields "steps", "judged_on", "start", "result", "over_sky", "returned", "claimed", "suspects", "log",
  // "sheet", "poses".
  void add_results(nlohmann::ordered_json& out) const;

 private:
  void draw_sheet(Session& session, const vsplat::Fit& fit, const vsplat::Scene& scene, Outputs& outputs) const;
  std::vector<std::string> names_of(const vsplat::Fit& fit, vsplat_fit_views which, const vsplat::Views& views) const;

  std::vector<std::string> holdout_;
  std::vector<const char*> holdout_pointers_;
  std::string log_, sheet_, poses_, checkpoint_;
  vsplat::Scene start_;
  vsplat_fit_result result_ = VSPLAT_FIT_RESULT_INIT;
  bool stopped_ = false;
  std::vector<std::string> judged_, suspects_;
};

// Plan of a step's memory, with a title: up to `gaussians`, with pictures of these cameras whose longer side is at most
// `longest`.
Plan plan_fit(const Session& session, std::uint64_t gaussians, int sh_degree, const std::vector<vsplat_camera>& cameras,
              int longest);

}  // namespace command
