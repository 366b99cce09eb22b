#include "model/ops/render/radix_sort.h"

#include <gtest/gtest.h>

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class RadixSort : public test::FlavourTest {};

TEST_P(RadixSort, RejectsBadShape) {
  EXPECT_THROW(radix_sort(ctx(), ctx().tensor({4}, Type::u32), ctx().tensor({5}, Type::u32), 32), Error);
  EXPECT_THROW(radix_sort(ctx(), ctx().tensor({4}, Type::f32), Tensor(), 32), Error);
  EXPECT_THROW(radix_sort(ctx(), ctx().tensor({4}, Type::u32), Tensor(), 33), Error);
}

VSPLAT_FLAVOURS(RadixSort);
VSPLAT_OPERATION(RadixSort, radix_sort)

}  // namespace
}  // namespace vsplat
