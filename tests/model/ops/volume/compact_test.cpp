#include "model/ops/volume/compact.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Compact : public test::FlavourTest {};
VSPLAT_FLAVOURS(Compact);
VSPLAT_OPERATION(Compact, compact)

TEST_P(Compact, NoneAndAll) {
  const Tensor none = ctx().upload({5}, std::vector<std::uint32_t>(5, 0), Type::u32);
  EXPECT_EQ(compact(ctx(), none, 3).dim(0), 0);
  const Tensor all = ctx().upload({5}, std::vector<std::uint32_t>(5, 1), Type::u32);
  EXPECT_EQ(ctx().read<int>(compact(ctx(), all, 3)), (std::vector<int>{0, 1, 2, 3, 4}));
  EXPECT_EQ(compact(ctx(), ctx().tensor({0}, Type::u32), 3).dim(0), 0);
}

}  // namespace
}  // namespace vsplat
