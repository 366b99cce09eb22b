// What a fit of a whole scene starts from.
#pragma once
#include <vector>

#include "model/api/fit_source.h"
#include "model/views/input.h"

namespace vsplat::api {

// Whether the fit is of a whole scene. VSPLAT_EXTENT_AUTO: unless the start is the network, a cube is given or listed,
// or pictures have masks or alpha. Error(usage) if a whole scene is requested together with a cube, which only the
// network needs.
bool is_whole(const Photographs& photographs, const vsplat_fit_options& o, const InputRequest& input,
              const std::vector<int>& used);

// As fit_source(). `photographs` must outlive what is returned. Pictures are fitted with `longest` pixels along their
// longer side, or unscaled if it is 0.
FitSource whole_source(vsplat_device device, const Photographs& photographs, const vsplat_fit_options& o,
                       const InputRequest& input, const std::vector<int>& used, int longest);

}  // namespace vsplat::api
