#include "runtime/compose_rows.h"

#include "runtime/gemm.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class ComposeRows : public test::FlavourTest {};
VSPLAT_FLAVOURS(ComposeRows);
VSPLAT_OPERATION(ComposeRows, compose_rows)

TEST_P(ComposeRows, RefusesRowsThatAreNotThere) {
  RowSource in;
  in.x0 = ctx().tensor({3, 5});
  EXPECT_THROW(compose_rows(ctx(), in, ctx().tensor({3, 5}), 1), Error);
  EXPECT_THROW(compose_rows(ctx(), in, ctx().tensor({3, 6})), Error);
}

}  // namespace
}  // namespace vsplat
