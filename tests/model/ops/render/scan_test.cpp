#include "model/ops/render/scan.h"

#include <gtest/gtest.h>

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class ScanOp : public test::FlavourTest {};
VSPLAT_FLAVOURS(ScanOp);
VSPLAT_OPERATION(ScanOp, scan)

TEST_P(ScanOp, RejectsBadShape) {
  EXPECT_THROW(exclusive_scan(ctx(), ctx().tensor({4}, Type::u32), ctx().tensor({4}, Type::u32)), Error);
  EXPECT_THROW(exclusive_scan(ctx(), ctx().tensor({4}), ctx().tensor({5}, Type::u32)), Error);
}

}  // namespace
}  // namespace vsplat
