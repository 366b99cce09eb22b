// A short fit of a network's Gaussians to the very pictures that the network got.
#pragma once
#include <array>
#include <functional>
#include <optional>
#include <vector>

#include "model/base/gaussians.h"
#include "model/base/image.h"
#include "model/fit/fit_picture.h"

namespace vsplat {

class Context;

// `alpha`, `masked`: as in PreparedView.
FitPicture fit_picture(const Image& on_white, const Image& alpha, bool masked, const Camera& camera);

struct InputsFit {
  long epochs = 0;                             // each takes a step on every picture
  std::optional<std::array<float, 3>> mirror;  // as in RenderOptions
  std::function<void(double)> progress;        // the share done; may throw
};

// `start`: volumes, in the frame of the pictures' cameras. Returns it unchanged without epochs, Gaussians or known
// pixels. The first half of the steps thins out: what no picture needs fades, and faint Gaussians go. The second half
// makes the others opaque.
Gaussians fitted_to_inputs(Context& ctx, const Gaussians& start, const std::vector<FitPicture>& pictures,
                           const InputsFit& fit);

// Runs a step in a planner, with `count` Gaussians of this degree and pictures of `image` x `image`.
void plan_inputs_fit(Context& planner, long count, int sh_degree, int image);

}  // namespace vsplat
