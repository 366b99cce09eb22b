#include "model/ops/networks/lara_maps.h"

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

void bind(Dims& d, const DevicePicture& picture, const Tensor& views, long view) {
  d.bind("colour", picture.colour, {"H", "W", "3"})
      .bind("alpha", picture.alpha, {"H", "W"})
      .bind("depth", picture.depth, {"H", "W"})
      .bind("views", views, {"V", "32"});
  if (view < 0 || view >= d["V"]) fail(Status::internal, "lara_maps: view {} of {}", view, d["V"]);
}

}  // namespace

LaraMaps lara_maps_forward(Context& ctx, const LaraMapsForward& a) {
  Dims d;
  bind(d, a.picture, a.views, a.view);
  d.bind("normal", a.picture.normal, {"H", "W", "3"});
  const long h = d["H"], w = d["W"];
  const auto map = [&](const Shape& shape, const char* what) { return ctx.tensor(shape, Type::f32, what); };
  const LaraMaps out{map({h, w, 3}, "lara.image"), map({h, w}, "lara.depth"), map({h, w, 3}, "lara.normal"),
                     map({h, w, 3}, "lara.depth_normal")};
  const double pixels = static_cast<double>(h) * static_cast<double>(w);
  ctx.launch({"lara_maps", "lara_maps_forward", ""}, items(h * w), {80 * pixels, 72 * pixels}, a.picture.colour,
             a.picture.alpha, a.picture.depth, a.picture.normal, a.views, a.view, written(out.image),
             written(out.depth), written(out.normal), written(out.depth_normal), w, h);
  return out;
}

PictureGradient lara_maps_backward(Context& ctx, const LaraMapsBackward& a) {
  const LaraMapsGradient& by = a.dmaps;
  Dims d;
  bind(d, a.picture, a.views, a.view);
  d.bind_optional("dmaps.image", by.image, {"H", "W", "3"});
  d.bind_optional("dmaps.alpha", by.alpha, {"H", "W"});
  d.bind_optional("dmaps.depth", by.depth, {"H", "W"});
  d.bind_optional("dmaps.normal", by.normal, {"H", "W", "3"});
  d.bind_optional("dmaps.depth_normal", by.depth_normal, {"H", "W", "3"});
  d.bind_optional("dmaps.distortion", by.distortion, {"H", "W"});
  const long h = d["H"], w = d["W"];
  const auto map = [&](bool wanted, const Shape& shape, const char* what) {
    return wanted ? ctx.tensor(shape, Type::f32, what) : Tensor();
  };
  const bool depth = by.alpha || by.depth || by.depth_normal;
  PictureGradient out;
  out.colour = map(static_cast<bool>(by.image), {h, w, 3}, "lara.by_colour");
  out.alpha = map(depth, {h, w}, "lara.by_alpha");
  out.depth = map(depth, {h, w}, "lara.by_depth");
  out.normal = map(static_cast<bool>(by.normal), {h, w, 3}, "lara.by_normal");
  out.distortion = by.distortion;
  const double pixels = static_cast<double>(h) * static_cast<double>(w);
  ctx.launch({"lara_maps", "lara_maps_backward", ""}, items(h * w), {400 * pixels, 100 * pixels}, a.picture.colour,
             a.picture.alpha, a.picture.depth, a.views, a.view, by.image, by.alpha, by.depth, by.normal,
             by.depth_normal, written(out.colour), written(out.alpha), written(out.depth), written(out.normal), w, h);
  return out;
}

}  // namespace vsplat
