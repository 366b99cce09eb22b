#include "model/reconstruct/selection_check.h"

#include <fmt/format.h>

#include <algorithm>

#include "runtime/option.h"

namespace vsplat {
namespace {

constexpr int least_volume = 8;  // in smaller volumes most voxels are at a face

// Measured with the shipped model, 4 and 16 views, R = 16. Share of the face voxels selected: 0.26 to 0.79 for
// photographs with background; up to 0.05 for masked or rendered pictures, up to 0.28 for boxes that fill their cube (a
// die: 0.59); 0.54 to 0.59 in a cube of half the size.
constexpr double most_with_background = 0.1, most_cut_out = 0.4;

}  // namespace

SelectedShares selected_shares(std::span<const int> selected, int volume) {
  const auto at_face = [volume](int voxel) {
    for (int k = 0; k < 3; ++k, voxel /= volume)
      if (voxel % volume == 0 || voxel % volume == volume - 1) return true;
    return false;
  };
  const double inside = std::max(volume - 2, 0), all = static_cast<double>(volume) * volume * volume;
  const double faces = all - inside * inside * inside;
  return {static_cast<double>(selected.size()) / all,
          static_cast<double>(std::count_if(selected.begin(), selected.end(), at_face)) / faces};
}

bool shows_background(std::span<const PreparedView> views) {
  constexpr float white = 0.95f;
  constexpr long fifth = 5;  // the square may exceed the picture, with white beside it
  long edge = 0, shown = 0;
  for (const PreparedView& view : views) {
    const int w = view.image.width, h = view.image.height;
    for (int y = 0; y < h; ++y)
      for (int x = 0; x < w; x += y == 0 || y == h - 1 ? 1 : std::max(w - 1, 1)) {
        const float* p = view.image.at(x, y);
        ++edge;
        shown += *std::min_element(p, p + 3) < white;
      }
  }
  return fifth * shown > edge;
}

std::string doubts_about(const SelectedShares& shares, int volume, bool background) {
  if (volume < least_volume || shares.faces <= (background ? most_with_background : most_cut_out)) return "";
  return fmt::format(
      "{:.0f} % of the voxels were selected, and {:.0f} % of those at the cube's faces, where an object in its "
      "cube has few: {}{} and {} place the cube, {} estimates it",
      100 * shares.all, 100 * shares.faces,
      background
          ? "the pictures seem to show their background, which is taken for the object. Give them alpha or masks "
            "(mask_path, or a folder masks/). Besides, "
          : "the object seems to be larger than the cube or beside it, and is cut off (or is a box that fills "
            "it). ",
      Option::center, Option::scale, Option::auto_frame);
}

}  // namespace vsplat
