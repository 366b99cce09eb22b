#include "model/ops/networks/lara_maps.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/lara_picture.h"
#include "model/ops/render/project.h"
#include "model/ops/render/rasterize.h"

namespace vsplat::selftest {
namespace {

void lara_maps_all(Checks& c) {
  for (const auto& [w, h] : c.some({std::array<int, 2>{3, 3}, {2, 17}, {7, 13}, {17, 5}}, {{1, 1}, {17, 2}})) {
    const LaraPicture m(w, h);
    const Shape map{h, w}, vectors{h, w, 3};
    const DevicePicture picture{c.up(vectors, m.colour), c.up(map, m.alpha), c.up(map, m.depth),
                                c.up(vectors, m.normal)};
    Camera other = m.camera;
    other.fx *= 2;
    const Tensor views = upload_views(c.ctx, {other, m.camera}, 0.2f, {});
    const LaraMaps got = lara_maps_forward(c.ctx, {picture, views, 1});
    const ref::PictureMaps wide = m.wide();
    const ref::LaraMaps want = ref::lara_maps(wide, m.camera, wide.alpha);
    c.close("colour", got.image, want.image, c.within(1e-6, 0));
    c.close("depth", got.depth, want.depth, 1e-6);
    c.close("normal", got.normal, want.normal, 1e-6);
    c.close("normal of depths", got.depth_normal, want.depth_normal, 3e-5);
    const auto to = LaraCotangent::random(m);
    const PictureGradient by =
        lara_maps_backward(c.ctx, {picture,
                                   views,
                                   1,
                                   {c.up(vectors, to.image), c.up(map, to.alpha), c.up(map, to.depth),
                                    c.up(vectors, to.normal), c.up(vectors, to.depth_normal), c.up(map, to.alpha)}});
    const auto differences = [&](std::vector<double> ref::PictureMaps::*field) { return to.differences(m, field); };
    c.close(
        "backward, colour", by.colour, [&] { return differences(&ref::PictureMaps::colour); }, 1e-5);
    c.close(
        "backward, alpha", by.alpha, [&] { return differences(&ref::PictureMaps::alpha); }, 5e-5);
    c.close(
        "backward, depth", by.depth, [&] { return differences(&ref::PictureMaps::depth); }, 5e-5);
    c.close(
        "backward, normal", by.normal, [&] { return differences(&ref::PictureMaps::normal); }, 1e-5);
    c.equal("backward, distortion", by.distortion, to.alpha);
  }
}

}  // namespace

VSPLAT_CASES(lara_maps, {"lara_maps", lara_maps_all})

}  // namespace vsplat::selftest
