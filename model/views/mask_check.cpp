#include "model/views/mask_check.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "runtime/fail.h"
#include "runtime/log.h"

namespace vsplat {

MaskShares mask_shares(PixelRows& mask) {
  std::vector<float> row(mask.row_size());
  std::size_t inside = 0, along = 0;
  MaskShares out;
  for (int y = 0; y < mask.height; ++y) {
    mask.next(row.data());
    for (int x = 0; x < mask.width; ++x) {
      const float value = row[static_cast<std::size_t>(x + 1) * static_cast<std::size_t>(mask.channels) - 1];
      const bool is_border = x == 0 || y == 0 || x == mask.width - 1 || y == mask.height - 1;
      inside += value > 0.5f;
      along += value > 0.5f && is_border;
      out.brightest = std::max(out.brightest, value);
    }
  }
  const double w = mask.width, h = mask.height;
  const double border = w > 1 && h > 1 ? 2 * (w + h) - 4 : w * h;
  out.all = static_cast<double>(inside) / (w * h);
  out.border = static_cast<double>(along) / border;
  return out;
}

void check_masks(const std::string& set, std::span<const MaskShares> masks, std::size_t views) {
  if (masks.empty()) return;
  if (masks.size() < views) {
    warn("{}: {} of the {} views that are used have a mask or an alpha channel; the others use the whole picture", set,
         masks.size(), views);
    return;
  }
  constexpr float black = 0.02f;  // 5 of 255
  const auto brightest = std::max_element(masks.begin(), masks.end(), [](const MaskShares& a, const MaskShares& b) {
                           return a.brightest < b.brightest;
                         })->brightest;
  if (brightest < black)
    fail(Status::input,
         "{}: the masks (or alpha channels) of all {} views that are used are black, their brightest value is {:.3g} "
         "of 255: white is the object, so nothing of it is left. Store masks of 0 and 1 as 0 and 255, and masks of 16 "
         "bits with values up to 65535",
         set, masks.size(), 255 * brightest);
  warn_of_inverted_masks(set, masks);
}

void warn_of_inverted_masks(const std::string& set, std::span<const MaskShares> masks) {
  // The border of a picture mostly shows background. In an inverted mask the border has a larger white share than the
  // whole mask. If an object fills the picture, its border is white, too, but the whole mask is even more so.
  const auto inverted = std::count_if(masks.begin(), masks.end(), [](const MaskShares& m) {
    return m.border > 0.5 && m.all < 0.99 && m.border > m.all + 0.02;
  });
  if (2 * static_cast<std::size_t>(inverted) > masks.size())
    warn(
        "{}: {} of {} masks are white along the picture's border and black inside: they seem to be inverted, since "
        "white is taken for the object; if the object is black, invert them (`mogrify -negate masks/*.png`)",
        set, inverted, masks.size());
}

}  // namespace vsplat
