#include "model/fit/fit_picture.h"

#include <algorithm>

#include "runtime/context.h"

namespace vsplat {

std::size_t bytes_of(const FitPicture& picture) {
  return picture.rgba.size() + picture.known.size() + picture.depth.size() * sizeof(float);
}

DeviceFitPicture upload(Context& ctx, const FitPicture& picture) {
  const long h = picture.camera.height, w = picture.camera.width;
  DeviceFitPicture out{picture.camera, ctx.upload({h, w, 4}, picture.rgba, Type::u8, "picture"), {}, picture.masked};
  if (!picture.known.empty()) out.known = ctx.upload({h, w}, picture.known, Type::u8, "known pixels");
  if (!picture.depth.empty()) out.depth = ctx.upload({h, w}, picture.depth, Type::f32, "depth");
  out.known_depths =
      static_cast<double>(std::count_if(picture.depth.begin(), picture.depth.end(), [](float v) { return v > 0; }));
  out.known_share = known_share(picture);
  out.window_share = known_window_share(picture.known, picture.camera.width, picture.camera.height);
  return out;
}

double known_share(const FitPicture& picture) {
  if (picture.known.empty()) return 1;
  const auto unknown = std::count(picture.known.begin(), picture.known.end(), std::uint8_t{0});
  return 1 - static_cast<double>(unknown) / static_cast<double>(picture.known.size());
}

double known_window_share(std::span<const std::uint8_t> known, int w, int h) {
  constexpr int side = 11;
  if (known.empty() || std::min(w, h) < side) return 1;
  const auto width = static_cast<std::size_t>(w);
  std::vector<int> since(width, side);  // rows since the last known pixel of each column
  long found = 0;
  for (int y = 0; y < h; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      const bool is_known = known[static_cast<std::size_t>(y) * width + x] != 0;
      since[x] = is_known ? 0 : since[x] + 1;
    }
    if (y < side - 1) continue;
    int columns = side;  // since the last that has a known pixel in the window's rows
    for (int x = 0; x < w; ++x) {
      columns = since[static_cast<std::size_t>(x)] < side ? 0 : columns + 1;
      if (x >= side - 1 && columns < side) ++found;
    }
  }
  return static_cast<double>(found) / (static_cast<double>(w - side + 1) * (h - side + 1));
}

}  // namespace vsplat
