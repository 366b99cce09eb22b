// Gradients that come together: one is added to another, or to some of its columns.
#pragma once
#include "runtime/context.h"

namespace vsplat {

struct AddColumns {
  Tensor x;         // [R, C]
  Tensor out;       // [R, W], not x: columns column .. column + C - 1 are added to, the others stay
  long column = 0;  // column + C <= W
};
void add_columns(Context& ctx, const AddColumns& a);

}  // namespace vsplat
