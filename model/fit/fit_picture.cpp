#include "model/fit/fit_picture.h"

#include <algorithm>

#include "runtime/context.h"

namespace vsplat {

DeviceFitPicture upload(Context& ctx, const FitPicture& picture) {
  const long h = picture.camera.height, w = picture.camera.width;
  DeviceFitPicture out{picture.camera, ctx.upload({h, w, 4}, picture.rgba, Type::u8, "picture"), {}, picture.masked};
  if (!picture.known.empty()) out.known = ctx.upload({h, w}, picture.known, Type::u8, "known pixels");
  out.known_share = known_share(picture);
  return out;
}

double known_share(const FitPicture& picture) {
  if (picture.known.empty()) return 1;
  const auto unknown = std::count(picture.known.begin(), picture.known.end(), std::uint8_t{0});
  return 1 - static_cast<double>(unknown) / static_cast<double>(picture.known.size());
}

}  // namespace vsplat
