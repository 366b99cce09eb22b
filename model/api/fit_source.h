// What a fit starts from.
#pragma once
#include <functional>
#include <limits>
#include <memory>
#include <vector>

#include "model/api/handle.h"
#include "model/fit/scene_fit.h"
#include "model/io/views/colmap_points.h"
#include "model/views/input.h"

namespace vsplat::api {

struct FitSource {
  FitStart start;
  double farthest_near = std::numeric_limits<double>::infinity();  // limit of the near plane, in world units
  bool whole = false;                                              // a whole scene rather than an object in its cube
  bool scattered = false;                                          // FitRequest::scattered
  std::vector<int> named;                                          // views requested for the network
  std::shared_ptr<std::vector<int>> selected = std::make_shared<std::vector<int>>();  // voxels, from its last run
};

// An object's cube, and what limits it.
struct PlacedObject {
  Placement cube;
  // The smallest and the median distance of a camera from the cube's centre.
  double nearest = 0, usual = 0;
};

// The object that the network makes in its cube.
struct NetworkObject {
  PlacedObject placed;
  std::vector<int> named;  // views requested for the network
  std::function<Scene(const std::vector<int>& views)> make;
};

// Error(usage) without a model. `selected` gets the voxels of each `make`.
NetworkObject network_object(vsplat_device device, const Photographs& photographs, const vsplat_fit_options& o,
                             const InputRequest& input, const std::vector<int>& used,
                             std::shared_ptr<std::vector<int>> selected);

// The sparse points of the views. Error names where they were searched for.
std::vector<ColoredPoint> points_of(const Photographs& photographs);

// Places the object, or the scene, and checks what the start needs; `used` are the views of `o`, `longest` as in
// FitRequest. Keeps the scene or model of `o` alive, but not device and photographs.
FitSource fit_source(vsplat_device device, const Photographs& photographs, const vsplat_fit_options& o,
                     const std::vector<int>& used, int longest);

}  // namespace vsplat::api
