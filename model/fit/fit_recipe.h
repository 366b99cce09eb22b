// Default options of a fit, found by experiment: one set for few views, one for many.
#pragma once
#include "model/fit/scene_fit.h"

namespace vsplat {

struct FitRecipe {
  FitOptions options;
  long steps = 0;          // unless the request sets them
  long measure_every = 0;  // steps between measurements on the held-out views
  int least_degree = 0;    // lowest degree of the spherical harmonics
  double consolidate = 1;  // share of the Gaussians that stays for the last quarter of the steps
};

// For a network's Gaussians and fewer views than kManyViews; without growth, and for any number of steps.
FitOptions options_for_predicted();
// The same, but Gaussians that no view needs fade.
FitOptions options_to_thin_out();

// The length in pixels of pictures' longer sides, unless the request sets it.
int longest_of(FitQuality quality);

// What pictures show of an object, on average.
struct ShownObject {
  double pixels = 0;
  double width = 1;  // of a square of so many pixels, at the centre of the frame and in its units
};

// The number of Gaussians that a dense start is merged to, at most; `object_pixels` as ShownObject::pixels.
std::size_t merged_count(const FitRequest& request, double object_pixels);

// `views`: the views used, both fitted and held out. `count`: Gaussians of the start.
FitRecipe fit_recipe(const FitRequest& request, long views, const ShownObject& shown, long count,
                     Predicted predicted = Predicted::no);

// The number of Gaussians in the steps from `step` to `steps`, on average, with `count` of them at `step`, the last
// phase's.
double mean_count(const FitRecipe& recipe, long step, long steps, long count);

// The time of a step with `later` Gaussians in that of one with `now`, for pictures of `pixels`: about what fits of
// whole scenes on a processor take (bench/results/README.md).
double step_growth(double pixels, double now, double later);

// Sets the number of Gaussians that a fit which starts with `count` grows to.
void grow_to(FitRecipe& recipe, long most, long count);

}  // namespace vsplat
