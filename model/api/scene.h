#pragma once
#include <memory>
#include <vector>

#include "model/api/handle.h"
#include "model/base/scene.h"
#include "model/io/ply.h"

struct vsplat_scene_impl : vsplat::api::Counted {
  std::shared_ptr<const vsplat::Scene> scene;
  std::vector<int> selected;  // voxels, ascending
  vsplat::SkippedGaussians skipped;
};
