#pragma once
#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "model/api/handle.h"
#include "model/api/result_memory.h"
#include "model/base/scene.h"
#include "model/io/scene/skipped_gaussians.h"

namespace vsplat::api {

// Converts an up direction of the C interface, of any length; none for 0, 0, 0. `what` names it in the error.
std::optional<std::array<float, 3>> up_of(const double (&up)[3], const char* what);

// Adds the caller's non-null arrays, with the sizes of `count` Gaussians of that degree; `what` names the struct.
void add_to(Outputs& outputs, const vsplat_gaussians& arrays, std::size_t count, int sh_degree,
            const std::string& what);
// Copies to the caller's non-null arrays, which must hold all Gaussians. A surfel's third scale is 0.
void copy_out(const Gaussians& from, const vsplat_gaussians& to);

}  // namespace vsplat::api

struct vsplat_scene_impl : vsplat::api::Counted {
  // The current scene. A call takes it once and uses that snapshot, so the scene may change while it is drawn.
  std::shared_ptr<const vsplat::Scene> now() const {
    const std::lock_guard lock(mutex_);
    return scene_;
  }
  void become(std::shared_ptr<const vsplat::Scene> scene) {
    const std::lock_guard lock(mutex_);
    scene_.swap(scene);  // the old one is destroyed after the lock is released
  }

  std::vector<int> selected;  // voxels, ascending
  vsplat::SkippedGaussians skipped;

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const vsplat::Scene> scene_;
};
