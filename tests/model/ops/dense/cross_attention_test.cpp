#include "model/ops/dense/cross_attention.h"

#include "tests/support/operation.h"

namespace vsplat {
namespace {

class CrossAttention : public test::FlavourTest {};
VSPLAT_FLAVOURS(CrossAttention);
VSPLAT_OPERATION(CrossAttention, cross_attention)

TEST_P(CrossAttention, EmptyAndBadShape) {
  const Tensor none = ctx().tensor({0, 6}), x = ctx().tensor({4, 6}), y = ctx().tensor({8, 6});
  cross_attention_forward(ctx(), {none, none, none, 2, {{}, {}, 1, 4}, none, {}});
  EXPECT_THROW(cross_attention_forward(ctx(), {x, y, y, 4, {{}, {}, 1, 2}, x, {}}), Error) << "6 channels in 4 heads";
  EXPECT_THROW(cross_attention_forward(ctx(), {x, y, y, 2, {{}, {}, 1, 3}, x, {}}), Error) << "8 keys in threes";
  EXPECT_THROW(cross_attention_forward(ctx(), {x, y, x, 2, {{}, {}, 1, 2}, x, {}}), Error);
  EXPECT_THROW(cross_attention_forward(ctx(), {x, y, y, 2, {{}, {}, 1, 2}, y, {}}), Error);
  const Tensor places = ctx().upload({8, 2}, std::vector<int>(16), Type::i32);
  AttentionGroups shared{{}, {}, 1, 4, places, {}, {}};
  EXPECT_THROW(cross_attention_forward(ctx(), {x, y, y, 2, shared, x, {}}), Error) << "places without a map";
  shared = {{}, {}, 1, 2, {}, ctx().upload({4, 1}, std::vector<int>(4), Type::i32), {}};
  EXPECT_THROW(cross_attention_forward(ctx(), {x, y, y, 2, shared, x, {}}), Error) << "parts of queries alone";
  const Tensor stats = ctx().tensor({4, 2});
  EXPECT_THROW(cross_attention_backward(ctx(), {x, y, y, 2, {{}, {}, 1, 2}, x, stats, x, x, x, y}), Error);
}

}  // namespace
}  // namespace vsplat
