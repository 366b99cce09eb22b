// Detects implausible masks before anything is computed from them.
#pragma once
#include <span>
#include <string>

#include "model/base/pixel_rows.h"

namespace vsplat {

// The object's share (the last channel over one half) of all of a mask's pixels and of those along the border.
struct MaskShares {
  double all = 0, border = 0;
  float brightest = 0;
};
MaskShares mask_shares(PixelRows& mask);

// Warns if most masks (or alpha channels) of the used views show the object along the border and the background inside,
// as inverted masks do. `set`: the beginning of the message.
void warn_of_inverted_masks(const std::string& set, std::span<const MaskShares> masks);

// Warns likewise, and throws Error(input) if no mask shows any object. If only some of the `views` that are used have a
// mask, it logs one warning about that and checks nothing else.
void check_masks(const std::string& set, std::span<const MaskShares> masks, std::size_t views);

}  // namespace vsplat
