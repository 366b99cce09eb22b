// Tables of the ray predictor that depend only on sizes: positions within windows, codes of views and tokens, and the
// windows.
#pragma once
#include <vector>

#include "model/networks/params/config_fields.h"

namespace vsplat {

// [max_views t t, share_dim]: equal in each window and view. Rows and columns count from 1; the first half of the
// channels encodes the row, the second the column.
std::vector<float> window_positions(const Config& config);

// [max_views t t, share_ray_dim]: the sum of a code of the view and one of the token, alternating sine and cosine, from
// 0.
std::vector<float> view_and_token_numbers(const Config& config);

// The tokens of each of the splits x splits windows of t x t tokens, and each token's region of the picture. Tokens of
// different regions are adjacent only because a shift wrapped the windows around the picture's border.
struct TokenWindows {
  long count = 0, length = 0;
  std::vector<int> tokens, parts;  // [count, length]
};
TokenWindows token_windows(long t, long splits, bool shifted);

}  // namespace vsplat
