#include "model/ops/networks/view_maps.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class ViewMaps : public test::FlavourTest {};
VSPLAT_FLAVOURS(ViewMaps);
VSPLAT_OPERATION(ViewMaps, view_maps)

TEST_P(ViewMaps, RejectsBadShape) {
  const ViewDrawings drawings{ctx().tensor({2, 3, 3, 3}), ctx().tensor({2, 3, 3}), ctx().tensor({2, 3, 3})};
  const Tensor images = ctx().tensor({3, 3, 3, 3}), maps = ctx().tensor({3, 3, 3, 8});
  EXPECT_THROW(view_maps_forward(ctx(), {images, drawings, 2, false, maps}), Error) << "views 2 to 4 of 3";
  EXPECT_THROW(view_maps_forward(ctx(), {images, drawings, 0, false, ctx().tensor({3, 3, 3, 7})}), Error);
  EXPECT_THROW(view_maps_backward(ctx(), {drawings, 2, false, maps, drawings}), Error);
}

}  // namespace
}  // namespace vsplat
