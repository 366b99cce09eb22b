#include "model/fit/fit_picture.h"

#include "runtime/context.h"

namespace vsplat {

DeviceFitPicture upload(Context& ctx, const FitPicture& picture) {
  const long h = picture.camera.height, w = picture.camera.width;
  DeviceFitPicture out{picture.camera, ctx.upload({h, w, 4}, picture.rgba, Type::u8, "picture"), {}, picture.masked};
  if (!picture.known.empty()) out.known = ctx.upload({h, w}, picture.known, Type::u8, "known pixels");
  return out;
}

}  // namespace vsplat
