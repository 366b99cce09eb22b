// What the ray predictor is told beside features, and follows from sizes alone: places within windows, numbers of views
// and tokens, and who looks at whom.
#pragma once
#include <vector>

#include "model/networks/params/config_fields.h"

namespace vsplat {

// [max_views t t, share_dim]: the same in each window and view. Rows and columns count from 1; the first half of the
// channels holds the row, the second the column.
std::vector<float> window_positions(const Config& config);

// [max_views t t, share_ray_dim]: the sum of a table of views and one of tokens, sine and cosine by turns, from 0.
std::vector<float> view_and_token_numbers(const Config& config);

// The tokens of each of splits x splits windows of t x t tokens, and the part of the picture that each is of: between
// tokens of two parts a border lies that a shift of the windows has joined.
struct TokenWindows {
  long count = 0, length = 0;
  std::vector<int> tokens, parts;  // [count, length]
};
TokenWindows token_windows(long t, long splits, bool shifted);

}  // namespace vsplat
