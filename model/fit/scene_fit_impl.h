// A fit in progress: its phases, and the state that a checkpoint stores. Included only by scene_fit,
// scene_fit_background, scene_fit_reduce, scene_fit_settings, scene_fit_state, scene_fit_step and scene_fit_time.
#pragma once
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "model/base/step_pace.h"
#include "model/fit/fit_pictures.h"
#include "model/fit/fit_plan.h"
#include "model/fit/fit_recipe.h"
#include "model/fit/scene_fit.h"
#include "model/fit/view_corrections.h"
#include "runtime/files/folder_lock.h"
#include "runtime/system/host_memory.h"

namespace vsplat {

// A phase of the fit: the views that it fits, and the held-out views that measure it.
struct Phase {
  std::string name;
  std::vector<int> views, held_out;
};

// Sum of the measurements made after a number of steps.
struct Measured {
  double psnr = 0, ssim = 0;  // over `pictures`
  int pictures = 0;
};

FitScore mean(const Measured& of);

// Work left after a step. If it is interrupted, the next call of step() completes it.
struct AfterStep {
  bool measures = false, measured = false, ends = false;  // `ends`: ends the phase
};

struct SceneFit::Impl {
  Impl(Context& c, const Photographs& p, FitStart s, FitRequest r);

  bool step();
  void follow(AfterStep& left);
  void finish();
  void begin_phase();
  void end_phase();
  void record_measurement();
  Measured measure_held_out();
  void reduce(const std::function<std::vector<bool>(const std::vector<float>&)>& choose, long at, bool thickens);
  void prune();
  void consolidate();
  bool is_consolidated() const;
  bool consolidates() const;
  bool consolidates_now() const;
  std::shared_ptr<const FitPicture> read_picture(int view);
  void read_ahead(std::vector<int> views);
  void read_ahead_of_steps();
  void with_each(const std::vector<int>& views, const std::function<void(int view)>& use);
  const DeviceFitPicture& on_device(int view);
  Camera corrected_camera(int view);
  DeviceFitPicture corrected(int view);
  void step_on(int view, const DeviceFitPicture& picture);
  int view_of_step(long step) const;
  void warn_of_background();
  void check_masks();
  SkySphere sky_sphere() const;
  FitScore score_written();  // of `best` on the held-out pictures of the current phase
  // Estimate for the next step, the work after it, and the measurement of all pictures at the end.
  double seconds_of_next() const;
  void leave_time_to_consolidate(double until_now);
  double seconds_of_reads(double steps) const;
  double seconds_of_look() const;
  double looks_at_end() const;
  double seconds_left() const;  // of all phases; 0: not known yet
  void hold_host_memory();
  void limit_growth(const Gaussians& start, float near, const Camera& largest);
  long measured_by_all(std::size_t rounds) const;
  bool has_time_for(double rounds) const;  // in the current fold's duration so far; true without a time limit
  ShownObject shown_object(const std::vector<int>& views);
  bool latest_is_best() const;
  Scene to_scene(const Gaussians& gaussians) const;
  std::string text_of_request() const;
  void save() const;
  void go_on(const FitCheckpoint& from);
  void read_place(const FitCheckpoint& from);
  void read_progress(const FitCheckpoint& from);
  bool in_folds() const { return phase + 1 < phases.size(); }

  Context& ctx;
  const Photographs& photographs;
  FitStart given;
  FitRequest request;
  std::string request_text;        // set if there is a checkpoint
  std::optional<FolderLock> lock;  // on the checkpoint folder
  Similarity to_world;
  FitPictures pictures;
  std::vector<int> used;
  std::size_t masked = 0;  // of the used views, those with a mask or alpha that marks an object

  std::vector<Phase> phases;  // the last phase makes the result; each one before it leaves one view out
  std::size_t phase = 0;
  FitRecipe recipe;
  int degree = 0;     // of the spherical harmonics
  long grows_to = 0;  // Gaussians, unless the request says so; a resumed fit keeps it, whatever memory there is now
  long pairs = 0;     // FitOptions::most_pairs; likewise
  long phase_steps = 0;
  std::unique_ptr<Fitter> fitter;  // of the current phase
  std::optional<Scene> first;      // the start of the last phase, in the world
  std::map<long, Measured> curve;  // by number of steps, over the folds or over the held-out pictures
  std::vector<int> held_out;
  std::map<int, PoseCorrection> poses;  // of the current phase, if requested
  std::map<int, ExposureCorrection> exposures;
  std::map<int, DeviceFitPicture> resident;
  DeviceFitPicture passing;
  std::size_t resident_bytes = 0;
  FitBudget budget;           // of the current phase
  HostMemory held;            // for cached pictures and scenes
  double largest_pixels = 0;  // of the largest picture

  bool done = false, unknown = false, resuming = false;
  double seconds = 0, phase_began = 0, last_psnr = std::nan("");
  int falls = 0;  // how often in a row the fold's PSNR has fallen
  // Latest durations: the shorter of the last two steps, since one may include a compilation, and one picture's
  // measurement.
  double last_step = 0, step_seconds = 0, look_seconds = 0;
  long steps_in_all = 0;
  // This run: its steps without waits for pictures; those waits in all, in seconds; the pictures waited for.
  StepPace pace;
  double waited = 0;
  long reads = 0;
  double report_delay = 0;  // seconds that progress() has waited for the device since the last step
  std::optional<AfterStep> left;
  long consolidated_after = 0;         // steps; 0: not yet
  bool pruned = false;                 // whether `best` is
  std::optional<Gaussians> unreduced;  // what prune() or consolidate() reduces, until it is done
  // The best scene of the last phase.
  std::optional<Gaussians> best;
  long best_steps = 0;
  std::optional<FitScore> written;  // how good it is with its sky as Gaussians, once the fit has ended
  std::vector<int> outliers;
};

}  // namespace vsplat
