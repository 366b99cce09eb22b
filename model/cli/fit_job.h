// Fitting a scene to the user's pictures: what `vsplat fit` and `reconstruct --refine` share.
#pragma once
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

#include "fit_page.h"
#include "live_fit.h"
#include "outputs.h"
#include "scene_page.h"
#include "session.h"

namespace command {

// Options as given; "" if not given. `vsplat fit` has all of them.
struct FitOptions {
  std::string steps, size, sheet;
  std::string quality = "draft", seconds, max_gaussians, strategy, consolidate, holdout, sh, freeze, seed, log,
              checkpoint, background, masks, depth, depth_weight;
  std::string page, record;  // paths; "": none
  std::string live;          // a port, or "auto"; "": no live page
  bool poses = false, exposure = false, resume = false, antialias = false, invert_masks = false;
};

// The fields of SCENE.fit.json.
inline constexpr const char* fit_record_fields[] = {"vsplat",   "views",   "scene",  "device",
                                                    "settings", "derived", "counts", "figures"};

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
  nlohmann::ordered_json given_settings =
      nlohmann::ordered_json::object();  // settings_in() of the options, for the record

  // `output`: the scene's file; poses are written beside it.
  void expect(Outputs& outputs, const std::string& output);
  double since = 0;  // elapsed_seconds() when the work on this scene began

  // Runs to the end, or until the user interrupts: then the best scene so far is the result, and a message says so.
  // Calls `on_start`, if there is one, with the start scene before the first step, and `on_result` with the result, to
  // write it, before the log, the record, the page and the sheet are written. If one of these fails, the others are
  // still written, and what was written stays; the error names those that failed.
  vsplat::Scene run(Session& session, const Common& common, const vsplat::Views& views, Outputs& outputs,
                    const std::function<void(const vsplat::Scene&)>& on_start,
                    const std::function<void(const vsplat::Scene&)>& on_result);
  // The memory at the largest size, and the time as the first steps foretell it. Writes nothing.
  Plan plan(const Session& session, const vsplat::Views& views);
  // Valid after run(), like start().
  const vsplat_fit_result& result() const { return result_; }
  // The start scene; valid after run().
  const vsplat::Scene& start() const { return start_; }
  // For a page: the start, by that name, and the fitted scene; or only the start, if that is the result.
  std::vector<PageScene> scenes(const std::string& start, const vsplat::Scene& result) const;
  // Prints the result, and warnings if any.
  void summarise(const Common& common) const;
  // Adds the fields "steps", "measured_on", "start", "result", "over_sky", "held_out", "returned", "claimed",
  // "outliers", "log", "sheet", "poses", "page", "settings".
  void add_results(nlohmann::ordered_json& out) const;

 private:
  void settle(const vsplat::Fit& fit);
  void remember(const vsplat_fit_progress& progress, double seconds);
  void measure(const Session& session, const vsplat::Fit& fit, const vsplat::Scene& scene, const vsplat::Views& views);
  void write_record(const Session& session, const vsplat::Fit& fit, const vsplat::Scene& scene, Outputs& outputs) const;
  void write_page(const Session& session, Outputs& outputs);
  void begin_live(const Common& common, const vsplat::Fit& fit, const vsplat::Views& views);
  void show_live(const Session& session, const vsplat::Fit& fit, const vsplat::Views& views);
  void end_page(const Session& session, const vsplat::Scene& scene, Outputs& outputs, double begun);
  void draw_sheet(Session& session, const vsplat::Fit& fit, const vsplat::Scene& scene, Outputs& outputs) const;
  std::vector<std::string> names_of(const vsplat::Fit& fit, vsplat_fit_views which, const vsplat::Views& views) const;

  std::vector<std::string> holdout_;
  std::vector<const char*> holdout_pointers_;
  std::string log_, sheet_, poses_, checkpoint_, page_path_, record_, output_, live_port_;
  nlohmann::ordered_json settings_, derived_;
  FitPage page_;
  std::unique_ptr<LiveFit> live_;
  vsplat::Scene start_;
  vsplat_fit_result result_ = VSPLAT_FIT_RESULT_INIT;
  int longest_ = 0;  // pixels of a picture's longer side; 0: its own size
  bool stopped_ = false, sky_ = false;
  std::vector<std::string> measured_on_, outliers_;
  std::size_t measured_ = 0;  // how many pictures of the page were held out: all of them or none
  double psnr_cc_ = std::numeric_limits<double>::quiet_NaN();  // mean over those
};

}  // namespace command
