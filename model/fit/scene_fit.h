// A fit of a scene to photographs: chooses the views to fit and to hold out, the number of steps, and the result.
#pragma once
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "model/base/scene.h"
#include "model/fit/fitter.h"
#include "model/views/photographs.h"
#include "model/views/placement.h"

namespace vsplat {

struct FitBudget;

// With fewer views than this, none is held out for the whole fit: each is left out in turn.
inline constexpr int kManyViews = 12;

struct FitHoldout {
  enum class Kind { automatic, none, count, named } kind = Kind::automatic;
  int count = 0;
  std::vector<std::string> names;  // as in ViewRequest
};

// Parameters that stay frozen.
struct FitFreeze {
  bool means = false, scales = false, rotations = false, opacities = false, sh = false;

  bool operator==(const FitFreeze&) const = default;
};

// Presets of the number of steps and the size of the pictures.
enum class FitQuality { draft, normal, high };

struct FitRequest {
  std::vector<std::string> names;  // the views to use, as in ViewRequest; empty: all that have a picture
  FitHoldout holdout;
  std::vector<int> spared;    // views that are held out only if they are named
  long steps = 0;             // 0: depends on the number of views and the quality
  double seconds = 0;         // limit for the whole fit, as far as can be estimated; 0: no limit
  long max_gaussians = 0;     // 0: depends on the pictures
  std::optional<int> degree;  // of the spherical harmonics
  int longest = 512;          // pixels of a picture's longer side; 0: the picture's own size
  FitQuality quality = FitQuality::draft;
  bool whole = false;      // a whole scene rather than an object in its cube
  bool scattered = false;  // a whole scene whose start has Gaussians at random places
  FitFreeze freeze;
  bool poses = false, exposure = false;
  bool antialias = false;  // also on where Scene::antialias of the start is
  DensityStrategy density = DensityStrategy::mcmc;
  double consolidate = 0;  // share of the Gaussians that stays for the last quarter of the steps; 0: the recipe's
  FitBackground background;
  float depth_weight = 0;  // with Photographs::depths; 0: they are not used
  std::string depth;       // what they are, as `vsplat fit --depth` calls it
  DepthKind depth_kind = DepthKind::metric;
  std::uint64_t seed = 0;
  // Checkpoint folder, written periodically; empty: no checkpoint. Only one fit at a time may use it. With `resume`,
  // the fit continues from the checkpoint there.
  std::string checkpoint;
  bool resume = false;
};

// Whether a scene is a network's, and if so, whether it was fitted to the network's pictures already
// (model/reconstruct/inputs_fit.h).
enum class Predicted { no, yes, fitted };

struct FitStart {
  // The frame of the fit: its centre, and its unit of length as the edge. For an object that is its cube, unless the
  // cube reaches beyond the cameras.
  Placement placement;
  // Returns the initial scene, in the world, made from what `views` show. Called for each set of views that is fitted.
  std::function<Scene(const std::vector<int>& views)> make;
  // Whether such a scene has seen nothing of the other views, so that an improvement on those is a real one.
  bool independent = false;
  // A network's scene may have more Gaussians than pictures can show; with many views they are merged to fewer, with
  // few the recipe is another.
  Predicted predicted = Predicted::no;
  double cube = 1;  // edge of the object's cube about the centre, in units of the frame
};

struct FitProgress {
  std::string phase;
  long step = 0, steps = 0;  // of the phase
  long gaussians = 0;
  double loss = std::numeric_limits<double>::quiet_NaN(), psnr = loss;  // as in vsplat_fit_progress
  double seconds_left = 0;
};

struct FitResult {
  Scene scene;  // in the world
  long steps = 0;
  double seconds = 0;
  bool start_returned = false;
  bool in_turn = false;               // with few views, each of `held_out` was left out in turn
  std::array<float, 3> background{};  // that pictures are measured over
  std::vector<int> held_out;          // the held-out views
  // Means over `held_out`. If the start is returned, `result` belongs to the best scene of the fit.
  FitScore start, result;
  // With a sky: how good the result was over the sky itself, where `result` is of the Gaussians that it became. NaN if
  // there is none, or if no view is held out for the whole fit.
  FitScore over_sky;
  std::vector<int> outliers;
};

class SceneFit {
 public:
  // Error(usage or input) for views, Error(memory) if a step would not fit. `photographs` and `ctx` must outlive it.
  SceneFit(Context& ctx, const Photographs& photographs, FitStart start, FitRequest request);
  ~SceneFit();
  SceneFit(const SceneFit&) = delete;
  SceneFit& operator=(const SceneFit&) = delete;

  // Runs one step; returns false once none is left. Waits for the device.
  bool step();
  void stop();  // runs no further step
  FitProgress progress() const;
  // The memory that was planned for the current phase, before it took any.
  const FitBudget& memory() const;
  // The settings in effect, as JSON: see vsplat_fit_get_settings.
  std::string settings() const;

  // The best scene so far; after the last step or stop(), the result.
  FitResult result();
  FitResult figures() const;  // the same without the scene
  const Scene& start() const;

  // A view's picture over measured_over(), and its camera, as used to fit or to measure.
  Image picture(int view);
  Camera camera(int view);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vsplat
