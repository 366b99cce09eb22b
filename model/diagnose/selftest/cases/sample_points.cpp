#include "model/diagnose/selftest/reference/sample_points.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/camera_ring.h"
#include "model/ops/volume/sample_points.h"

namespace vsplat::selftest {
namespace {

void sample_points_all(Checks& c) {
  struct Try {
    int views;
    long size, points;
    bool half_pixel;
    float reach;
  };
  for (const Try& t :
       c.some({Try{1, 1, 1, true, 0.5f}, {2, 7, 17, true, 0.5f}, {3, 8, 31, false, 0.5f}, {3, 5, 65, true, 1.2f}},
              {{4, 5, 65, true, 0.4f}, {3, 5, 150, true, 1.2f}, {2, 3, 0, true, 1}})) {
    ref::SamplePointsCase want;
    want.size = t.size, want.half_pixel = t.half_pixel, want.cameras = orbit(t.views, static_cast<int>(t.size));
    const long v = t.views;
    const auto maps = random_floats(size_of(v * t.size * t.size, 8), 31),
               points = random_floats(size_of(3 * t.points), 32, -t.reach, t.reach),
               dout = random_floats(size_of(8 * v, t.points), 33), before = random_floats(points.size(), 34),
               already = random_floats(maps.size(), 35);
    want.maps = as_doubles(maps), want.points = as_doubles(points);
    const DeviceCameras cameras = upload_cameras(c.ctx, want.cameras);
    const SamplePointsForward f{c.up({v, t.size, t.size, 8}, maps), c.up({t.points, 3}, points), &cameras, t.half_pixel,
                                c.gap({t.points, v, 8})};
    sample_points_forward(c.ctx, f);
    c.close_by_column("forward", c.ctx.read<float>(f.out), 8, want.all(), 2e-5);
    const Tensor dpoints = c.up({t.points, 3}, before), dmaps = c.up({v, t.size, t.size, 8}, already);
    const Tensor by = c.up({t.points, v, 8}, dout);
    sample_points_backward(c.ctx, {f, by, dpoints, dmaps});
    c.close(
        "backward, dpoints", dpoints, [&] { return plus(want.points_gradient(dout), before); }, 5e-5);
    if (c.all) {
      const Tensor alone = c.up({t.points, 3}, before);
      sample_points_backward(c.ctx, {f, by, alone, {}});
      c.equal("backward, without dmaps", alone, c.ctx.read<float>(dpoints));
    }
    c.close(
        "backward, dmaps", dmaps, [&] { return plus(want.maps_gradient(dout), already); }, 2e-5);
  }
}

}  // namespace

VSPLAT_CASES(sample_points, {"sample_points", sample_points_all})

}  // namespace vsplat::selftest
