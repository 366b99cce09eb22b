#include "model/ops/dense/layer_scale.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class LayerScale : public test::FlavourTest {};
VSPLAT_FLAVOURS(LayerScale);
VSPLAT_OPERATION(LayerScale, layer_scale)

TEST_P(LayerScale, EmptyAndBadShape) {
  const Tensor none = ctx().tensor({0}), empty = ctx().tensor({0, 3}), w = ctx().tensor({2, 3}), b = ctx().tensor({2});
  layer_scale_forward(ctx(), {empty, none, none, empty, none});
  EXPECT_THROW(layer_scale_forward(ctx(), {w, b, ctx().tensor({3}), w, b}), Error);
  EXPECT_THROW(layer_scale_backward(ctx(), {w, b, b, w, b, w, b, ctx().tensor({3})}), Error);
}

}  // namespace
}  // namespace vsplat
