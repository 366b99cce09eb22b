// What pictures show beside the object's cube, where there is nothing that a fit may imitate it with.
#pragma once
#include <string>
#include <vector>

#include "model/fit/fit_picture.h"

namespace vsplat {

// The share of a picture's pixels that show something, not white, beside the square of the cube [-0.5,0.5]^3. 0 of a
// picture that says what the object is, and where a corner of the cube is behind the camera.
double shown_beside_cube(const FitPicture& picture);

// What to warn of, or "": `shares` of the pictures that were looked at, `unmasked` of all `pictures`.
std::string doubts_about_cube(const std::vector<double>& shares, std::size_t unmasked, std::size_t pictures);

}  // namespace vsplat
