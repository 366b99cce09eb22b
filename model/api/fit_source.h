// What a fit starts from.
#pragma once
#include <memory>
#include <vector>

#include "model/api/handle.h"
#include "model/fit/scene_fit.h"

namespace vsplat::api {

struct FitSource {
  FitStart start;
  std::vector<int> named;                                                             // views requested for the network
  std::shared_ptr<std::vector<int>> selected = std::make_shared<std::vector<int>>();  // voxels, from its last run
};

// Places the object and checks what the start needs; `used` are the views of `o`. Keeps the scene or model of `o`
// alive, but not device and photographs.
FitSource fit_source(vsplat_device device, const Photographs& photographs, const vsplat_fit_options& o,
                     const std::vector<int>& used);

}  // namespace vsplat::api
