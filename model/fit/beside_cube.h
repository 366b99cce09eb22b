// Measures what pictures show outside the object's cube, where a fit has no Gaussians to reproduce it with.
#pragma once
#include <array>
#include <string>
#include <vector>

#include "model/fit/fit_picture.h"

namespace vsplat {

// The share of a picture's pixels outside the projected cube [-edge/2,edge/2]^3 that are known and do not have the
// colour of the background. 0 if the picture is masked, or if a corner of the cube is behind the camera.
double shown_beside_cube(const FitPicture& picture, double edge = 1,
                         const std::array<float, 3>& background = {1, 1, 1});

// Returns the text of a warning, or "" if no warning is due. `shares`: of the pictures that were measured; `unmasked`:
// how many of all `pictures` have no mask.
std::string doubts_about_cube(const std::vector<double>& shares, std::size_t unmasked, std::size_t pictures);

}  // namespace vsplat
