// How a scene is fitted: what was found to serve few views, and many.
#pragma once
#include "model/fit/scene_fit.h"

namespace vsplat {

struct FitRecipe {
  FitOptions options;
  long steps = 0;        // where nothing else is asked for
  long judge_every = 0;  // steps between looks at what is held out
  int least_degree = 0;  // of the spherical harmonics
};

// `views` are used, fitted to or held out, whose pictures show the object on `object_pixels` on average; `count`:
// Gaussians of the start.
FitRecipe fit_recipe(const FitRequest& request, long views, double object_pixels, long count);

}  // namespace vsplat
