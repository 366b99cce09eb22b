// A scene moved towards the user's pictures: what `refine` and `reconstruct --refine` have in common.
#pragma once
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "outputs.h"
#include "session.h"

namespace command {

// As given; "" where an option was not. `refine` has all of them.
struct RefineOptions {
  std::string steps, size, sheet;
  std::string seconds, max_gaussians, holdout, sh, freeze, seed, log, checkpoint;
  bool poses = false, exposure = false, resume = false;
};

// What the options are called in messages.
struct RefineNames {
  const char *steps = "--steps", *size = "--size", *sheet = "--sheet", *time = "--time";
};

class RefineJob {
 public:
  // Everything that can be wrong with the request itself is found here.
  explicit RefineJob(const RefineOptions& given, const RefineNames& names = {});
  RefineJob(const RefineJob&) = delete;
  RefineJob& operator=(const RefineJob&) = delete;

  // Start, scene, model, input and names are the caller's.
  vsplat_refine_options options = VSPLAT_REFINE_OPTIONS_INIT;

  // `output`: the scene's file, beside which poses are written.
  void expect(Outputs& outputs, const std::string& output);
  // To the end, or until the user interrupts: then the best so far is the result, and that is said. `on_start` is given
  // the scene that it begins with, before the first step.
  vsplat::Scene run(Session& session, const Common& common, const vsplat::Views& views, Outputs& outputs,
                    const std::function<void(const vsplat::Scene&)>& on_start = {});
  // What it began with; after run().
  const vsplat::Scene& start() const { return start_; }
  // In words, and what there is to warn of.
  void summarise(const Common& common) const;
  // The fields "steps", "judged_on", "start", "result", "returned", "claimed", "suspects", "log", "sheet", "poses".
  void add_results(nlohmann::ordered_json& out) const;

 private:
  void draw_sheet(Session& session, const vsplat::Refinement& refinement, const vsplat::Scene& scene,
                  Outputs& outputs) const;
  std::vector<std::string> names_of(const vsplat::Refinement& refinement, vsplat_refine_views which,
                                    const vsplat::Views& views) const;

  std::vector<std::string> holdout_;
  std::vector<const char*> holdout_pointers_;
  std::string log_, sheet_, poses_, checkpoint_;
  vsplat::Scene start_;
  vsplat_refine_result result_ = VSPLAT_REFINE_RESULT_INIT;
  bool stopped_ = false;
  std::size_t used_ = 0;
  std::vector<std::string> judged_, suspects_;
};

// Memory of a step, titled: up to `gaussians`, pictures of these cameras with their longer side at most `longest`.
Plan plan_refinement(const Session& session, std::uint64_t gaussians, int sh_degree,
                     const std::vector<vsplat_camera>& cameras, int longest);

}  // namespace command
