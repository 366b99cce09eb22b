#include "model/ops/dense/patch_embed.h"

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/patch_embed.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class PatchEmbed : public test::FlavourTest {};
VSPLAT_FLAVOURS(PatchEmbed);
VSPLAT_OPERATION(PatchEmbed, patch_embed)

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

// The reference for the backward kernels is itself checked against differences of the forward reference.
TEST(PatchEmbedReference, GradientsAreThoseOfDifferences) {
  const ref::PatchSizes z{2, 4, 6, 2, 3};
  const std::size_t c = 3;
  const auto images = test::random_floats(z.v * z.height * z.width * 3, 1, 0, 1);
  auto weight = test::random_doubles(c * 3 * z.p * z.p, 2), bias = test::random_doubles(c, 3),
       position = test::random_doubles(z.rows() * c, 4);
  const auto dtokens = test::random_doubles(z.v * z.tokens() * c, 5);
  const auto slopes = [&](std::vector<double>& of) {
    return ref::linear_differences(
        of, [&] { return ref::weighed(ref::patch_embed(images, z, weight, bias, position), dtokens); });
  };
  const auto want = ref::patch_embed_backward(images, z, c, dtokens);
  EXPECT_TRUE(test::close(want.weight, slopes(weight), 1e-12));
  EXPECT_TRUE(test::close(want.bias, slopes(bias), 1e-12));
  EXPECT_TRUE(test::close(want.position, slopes(position), 1e-12));
}

class PatchEmbedGradient : public test::FlavourTest {};
VSPLAT_FLAVOURS(PatchEmbedGradient);

TEST_P(PatchEmbedGradient, OfNoPictureIsZero) {
  const auto some = test::random_floats(5 * 12, 1);
  const PatchEmbedBackward a{ctx().tensor({0, 4, 4, 3}), 2,
                             ctx().tensor({0, 5, 5}),    ctx().upload({5, 3, 2, 2}, some),
                             ctx().tensor({5}),          ctx().upload({5, 5}, test::nans(25))};
  patch_embed_backward(ctx(), a);
  EXPECT_EQ(ctx().read<float>(a.dweight), some);
  EXPECT_EQ(ctx().read<float>(a.dposition), std::vector<float>(25, 0.0f));
}

TEST_P(PatchEmbedGradient, RejectsBadShape) {
  const Tensor dweight = ctx().tensor({5, 3, 2, 2}), dbias = ctx().tensor({5}), dposition = ctx().tensor({5, 5});
  PatchEmbedBackward a{ctx().tensor({1, 5, 5, 3}), 2, ctx().tensor({1, 5, 5}), dweight, dbias, dposition};
  EXPECT_THROW(patch_embed_backward(ctx(), a), Error);  // 5 pixels are not a number of patches
  a.images = ctx().tensor({1, 6, 6, 3});
  EXPECT_THROW(patch_embed_backward(ctx(), a), Error);  // 9 patches, 4 tokens
  a.images = ctx().tensor({1, 4, 4, 3});
  a.dweight = ctx().tensor({5, 12});
  EXPECT_THROW(patch_embed_backward(ctx(), a), Error);
}

}  // namespace
}  // namespace vsplat
