#include "model/data/disguise.h"

#include <algorithm>

namespace vsplat {
namespace {

// Reverses each row of [rows, side, channels].
template <class T>
void mirror_rows(std::vector<T>& picture, int side, int channels) {
  const auto row = static_cast<std::size_t>(side) * channels;
  for (std::size_t from = 0; from + row <= picture.size(); from += row)
    for (int x = 0; x < side / 2; ++x)
      std::swap_ranges(picture.begin() + static_cast<std::ptrdiff_t>(from) + x * channels,
                       picture.begin() + static_cast<std::ptrdiff_t>(from) + (x + 1) * channels,
                       picture.begin() + static_cast<std::ptrdiff_t>(from) + (side - 1 - x) * channels);
}

template <class T>
void shuffle(std::vector<T>& picture, int channels, const std::array<int, 3>& order) {
  for (auto at = picture.begin(); at != picture.end(); at += channels) {
    const std::array<T, 3> was = {at[0], at[1], at[2]};
    for (int c = 0; c < 3; ++c) at[c] = was[static_cast<std::size_t>(order[static_cast<std::size_t>(c)])];
  }
}

}  // namespace

// With the mirror M = diag(-1, 1, 1) applied to both the world and the camera, a rotation remains a rotation.
void mirror(TrainingViews& views) {
  if (views.cameras.empty()) return;
  const int side = views.cameras[0].width;
  for (Camera& camera : views.cameras) {
    camera.w2c.row(0) *= -1;
    camera.w2c.col(0) *= -1;
    camera.cx = camera.width - camera.cx;
  }
  mirror_rows(views.pictures, side, 3);
  for (auto& rgba : views.rgba) mirror_rows(rgba, side, 4);
}

void shuffle_channels(TrainingViews& views, const std::array<int, 3>& order) {
  shuffle(views.pictures, 3, order);
  for (auto& rgba : views.rgba) shuffle(rgba, 4, order);
}

}  // namespace vsplat
