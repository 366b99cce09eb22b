// A scene fitted to photographs: which of them are fitted to and which judge, how many steps, and what comes out.
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

// With fewer views than this none can be spared to judge: each is left out in turn.
inline constexpr int kManyViews = 12;

struct FitHoldout {
  enum class Kind { automatic, none, count, named } kind = Kind::automatic;
  int count = 0;
  std::vector<std::string> names;  // as ViewRequest has them
};

// Parameters that stay as they are.
struct FitFreeze {
  bool means = false, scales = false, rotations = false, opacities = false, sh = false;
};

struct FitRequest {
  std::vector<std::string> names;  // the views that are used, as ViewRequest has them; empty: all that have a picture
  FitHoldout holdout;
  std::vector<int> spared;  // views that are not held out unless they are named
  long steps = 0;           // 0: by the number of views
  double seconds = 0;      // the last step, and what follows it, ends before so long as far as can be told; 0: no limit
  long max_gaussians = 0;  // 0: by the pictures
  std::optional<int> degree;  // of the spherical harmonics
  int longest = 512;          // pixels of a picture's longer side; 0: as it is
  FitFreeze freeze;
  bool poses = false, exposure = false;
  std::uint64_t seed = 0;
  // A folder for the state, which is written now and then, by one fit at a time; none: "". With `resume` what is
  // there is gone on with.
  std::string checkpoint;
  bool resume = false;
};

struct FitStart {
  Placement placement;
  // The scene to begin with, in the world, from what these views show. Called for each set of views that is fitted to.
  std::function<Scene(const std::vector<int>& views)> make;
  // Whether a scene so made has seen nothing of the other views: then a gain on those is one.
  bool independent = false;
};

struct FitProgress {
  std::string phase;
  long step = 0, steps = 0;  // of the phase
  long gaussians = 0;
  double loss = std::numeric_limits<double>::quiet_NaN(), psnr = loss;  // as vsplat_refine_progress has them
  double seconds_left = 0;
};

struct FitResult {
  Scene scene;  // in the world
  long steps = 0;
  double seconds = 0;
  bool start_returned = false;
  std::vector<int> judged;  // views
  // Means over them. Where the start is returned `result` is the best of what was made.
  FitScore start, result;
  std::vector<int> suspects;
};

class SceneFit {
 public:
  // Error(usage or input) for views, Error(memory) where a step would not fit. `photographs` and `ctx` must outlive it.
  SceneFit(Context& ctx, const Photographs& photographs, FitStart start, FitRequest request);
  ~SceneFit();
  SceneFit(const SceneFit&) = delete;
  SceneFit& operator=(const SceneFit&) = delete;

  // One step; false once there is none left. Waits for the device.
  bool step();
  void stop();  // no further step
  FitProgress progress() const;

  // The best so far; after the last step, or stop(), the result.
  FitResult result();
  const Scene& start() const;

  // A view as it is fitted or judged: over white.
  Image picture(int view);
  Camera camera(int view);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace vsplat
