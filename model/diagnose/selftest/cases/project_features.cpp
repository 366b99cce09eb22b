#include "model/diagnose/selftest/reference/project_features.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/camera_ring.h"
#include "model/ops/networks/project_features.h"

namespace vsplat::selftest {
namespace {

void project_features_all(Checks& c) {
  struct Try {
    int views;
    long t, channels, points;
    bool half_pixel, by_distance;
    float reach = 0.5f;
  };
  for (const Try& t :
       c.some({Try{1, 7, 1, 1, true, false},
               {2, 3, 3, 17, true, false},
               {3, 6, 24, 31, false, false},
               {4, 8, 130, 33, true, true},
               {3, 5, 4, 300, true, false, 1.2f}},
              {{4, 8, 6, 33, false, true}, {3, 5, 4, 500, true, false, 1.2f}, {2, 2, 3, 0, true, false, 1}})) {
    ref::ProjectFeaturesCase want;
    want.t = t.t, want.channels = t.channels, want.half_pixel = t.half_pixel, want.by_distance = t.by_distance;
    want.image = static_cast<int>(8 * t.t), want.cameras = orbit(t.views, want.image);
    const long v = t.views;
    const auto features = random_floats(size_of(v * t.t * t.t, t.channels), 31),
               points = random_floats(size_of(3 * t.points), 32, -t.reach, t.reach),
               dout = random_floats(size_of(t.points, t.channels), 33), before = random_floats(points.size(), 34),
               already = random_floats(features.size(), 36);
    want.features = as_doubles(features), want.points = as_doubles(points);
    const DeviceCameras cameras = upload_cameras(c.ctx, want.cameras);
    ProjectFeaturesBackward b;
    b.forward = {c.up({v, t.t, t.t, t.channels}, features),
                 c.up({t.points, 3}, points),
                 &cameras,
                 want.image,
                 t.half_pixel,
                 t.by_distance,
                 c.gap({t.points, t.channels})};
    project_features_forward(c.ctx, b.forward);
    c.close("forward", b.forward.out, ref::project_features(want), 2e-5);
    b.dout = c.up({t.points, t.channels}, dout), b.dpoints = c.up({t.points, 3}, before);
    b.dfeatures = c.up({v, t.t, t.t, t.channels}, already);
    project_features_backward(c.ctx, b);
    const auto by = ref::project_features_backward(want, dout);
    c.close("backward, dpoints", b.dpoints, plus(by.points, before), 2e-5);
    c.close("backward, dfeatures", b.dfeatures, plus(by.features, already), 2e-5);
  }
}

}  // namespace

VSPLAT_CASES(project_features, {"project_features", project_features_all})

}  // namespace vsplat::selftest
