// Adds one tensor to another, or some of its columns to some of the other's.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct AddColumns {
  Tensor x;         // [R, X]; C is all of its columns
  Tensor out;       // [R, W], not x: columns column .. column + C - 1 are added to, the others stay
  long column = 0;  // column + C <= W
  // Adds columns from .. from + count - 1 of x, C = count; count < 0: all columns from `from` on.
  long from = 0, count = -1;
};
void add_columns(Context& ctx, const AddColumns& a);

}  // namespace vsplat
