#pragma once
#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "model/api/handle.h"
#include "model/api/outputs.h"
#include "model/base/scene.h"
#include "model/io/scene/ply.h"

namespace vsplat::api {

// A direction of the C interface, of any length, as scenes hold it; none for 0, 0, 0. `what` names it in the error.
std::optional<std::array<float, 3>> up_of(const double (&up)[3], const char* what);

// The caller's arrays that are not null, as `count` Gaussians of that degree fill them; `what` names the struct.
void add_to(Outputs& outputs, const vsplat_gaussians& arrays, std::size_t count, int sh_degree,
            const std::string& what);
// To the caller's arrays that are not null, each with room for all of them. A surfel's third scale is 0.
void copy_out(const Gaussians& from, const vsplat_gaussians& to);

}  // namespace vsplat::api

struct vsplat_scene_impl : vsplat::api::Counted {
  // What it is at the moment. A call asks once and goes on with that, so that a scene may change while it is drawn.
  std::shared_ptr<const vsplat::Scene> now() const {
    const std::lock_guard lock(mutex_);
    return scene_;
  }
  void become(std::shared_ptr<const vsplat::Scene> scene) {
    const std::lock_guard lock(mutex_);
    scene_.swap(scene);  // the old one goes after the lock
  }

  std::vector<int> selected;  // voxels, ascending
  vsplat::SkippedGaussians skipped;

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const vsplat::Scene> scene_;
};
