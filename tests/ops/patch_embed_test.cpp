#include "model/ops/patch_embed.h"

#include "tests/reference/patch_embed.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

class PatchEmbed : public test::FlavourTest {};
VSPLAT_FLAVOURS(PatchEmbed);

TEST_P(PatchEmbed, MatchesTheConvolution) {
  struct Size {
    long v, s, p, c;
  };
  for (const Size& n : {Size{1, 1, 1, 1}, {2, 6, 3, 7}, {3, 21, 7, 12}, {1, 48, 16, 33}, {2, 34, 17, 5}}) {
    const long k = 3 * n.p * n.p, tokens = 1 + (n.s / n.p) * (n.s / n.p);
    const auto images = test::random_floats(static_cast<std::size_t>(n.v * n.s * n.s * 3), 1, 0, 1);
    const auto weight = test::random_floats(static_cast<std::size_t>(n.c * k), 2);
    const auto bias = test::random_floats(static_cast<std::size_t>(n.c), 3);
    const auto position = test::random_floats(static_cast<std::size_t>(tokens * n.c), 4, -5, 5);
    const PackedMatrix packed = pack_matrix(ctx(), weight.data(), k, n.c, 1, k, "weight");
    PatchEmbedForward a{ctx().upload({n.v, n.s, n.s, 3}, images),
                        static_cast<int>(n.p),
                        &packed,
                        ctx().upload({n.c}, bias),
                        ctx().upload({tokens, n.c}, position),
                        ctx().upload({n.v, tokens, n.c}, test::nans(static_cast<std::size_t>(n.v * tokens * n.c)))};
    patch_embed_forward(ctx(), a);
    EXPECT_TRUE(test::close(ctx().read<float>(a.out),
                            ref::patch_embed(images, static_cast<std::size_t>(n.v), static_cast<std::size_t>(n.s),
                                             static_cast<std::size_t>(n.p), weight, bias, position),
                            1e-5))
        << n.v << " pictures of " << n.s << ", patches of " << n.p << ", " << n.c << " channels";
  }
}

TEST_P(PatchEmbed, RejectsBadShape) {
  const std::vector<float> weight(12 * 5, 1.0f);
  const PackedMatrix packed = pack_matrix(ctx(), weight.data(), 12, 5, 1, 12, "weight");
  const Tensor bias = ctx().tensor({5}), position = ctx().tensor({5, 5}), out = ctx().tensor({1, 5, 5});
  PatchEmbedForward a{ctx().tensor({1, 5, 5, 3}), 2, &packed, bias, position, out};
  EXPECT_THROW(patch_embed_forward(ctx(), a), Error);  // 5 pixels are not a number of patches
  a.images = ctx().tensor({1, 6, 6, 3});
  EXPECT_THROW(patch_embed_forward(ctx(), a), Error);  // 9 patches, 4 positions
  a.images = ctx().tensor({1, 4, 4, 3});
  a.patch = 4;
  EXPECT_THROW(patch_embed_forward(ctx(), a), Error);
}

}  // namespace
}  // namespace vsplat
