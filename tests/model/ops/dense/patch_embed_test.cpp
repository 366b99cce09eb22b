#include "model/ops/dense/patch_embed.h"

#include <fmt/format.h>

#include "model/diagnose/selftest/reference/patch_embed.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

struct PatchEmbedCase {
  ref::PatchSizes z;
  std::size_t c;
};

// Then: with registers and no positions, wide and high.
const PatchEmbedCase kPatchEmbedSizes[] = {
    {{1, 1, 1, 1}, 1},    {{2, 6, 6, 3}, 7},    {{3, 21, 21, 7}, 12},         {{1, 48, 48, 16}, 33},
    {{2, 34, 34, 17}, 5}, {{4, 36, 36, 3}, 65}, {{2, 6, 10, 2, 5, false}, 7}, {{1, 10, 4, 2, 3}, 5},
    {{1, 3, 6, 3, 0}, 6}};

std::string patch_embed_text(const ref::PatchSizes& z, std::size_t c) {
  return fmt::format("{} pictures of {} x {}, patches of {}, {} tokens before them, {} channels", z.v, z.width,
                     z.height, z.p, z.prefix, c);
}
Shape shape_of_pictures(const ref::PatchSizes& z) {
  return {static_cast<long>(z.v), static_cast<long>(z.height), static_cast<long>(z.width), 3};
}
Shape shape_of_tokens(const ref::PatchSizes& z, std::size_t c) {
  return {static_cast<long>(z.v), static_cast<long>(z.tokens()), static_cast<long>(c)};
}

class PatchEmbed : public test::FlavourTest {};
VSPLAT_FLAVOURS(PatchEmbed);

TEST_P(PatchEmbed, MatchesTheConvolution) {
  for (const auto& [z, c] : kPatchEmbedSizes) {
    SCOPED_TRACE(patch_embed_text(z, c));
    const std::size_t k = 3 * z.p * z.p;
    const auto images = test::random_floats(z.v * z.height * z.width * 3, 1, 0, 1);
    const auto weight = test::random_floats(c * k, 2);
    const auto bias = test::random_floats(c, 3);
    const auto position = test::random_floats(z.rows() * c, 4, -5, 5);
    const long channels = static_cast<long>(c), inner = static_cast<long>(k);
    const PackedMatrix packed = pack_matrix(ctx(), weight.data(), inner, channels, 1, inner, "weight");
    PatchEmbedForward a{ctx().upload(shape_of_pictures(z), images),
                        static_cast<int>(z.p),
                        &packed,
                        ctx().upload({channels}, bias),
                        ctx().upload({static_cast<long>(z.rows()), channels}, position),
                        ctx().upload(shape_of_tokens(z, c), test::nans(z.v * z.tokens() * c))};
    patch_embed_forward(ctx(), a);
    EXPECT_TRUE(test::close(ctx().read<float>(a.out), ref::patch_embed(images, z, weight, bias, position), 1e-5));
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

// The reference for the backward kernels is itself checked against differences of the forward reference.
TEST(PatchEmbedReference, GradientsAreThoseOfDifferences) {
  const ref::PatchSizes z{2, 4, 6, 2, 3};
  const std::size_t c = 3;
  const auto doubles = [](const std::vector<float>& values) {
    return std::vector<double>(values.begin(), values.end());
  };
  const auto images = test::random_floats(z.v * z.height * z.width * 3, 1, 0, 1);
  auto weight = doubles(test::random_floats(c * 3 * z.p * z.p, 2)), bias = doubles(test::random_floats(c, 3));
  auto position = doubles(test::random_floats(z.rows() * c, 4));
  const auto dtokens = doubles(test::random_floats(z.v * z.tokens() * c, 5));
  const auto slopes = [&](std::vector<double>& of) {
    std::vector<double> out;
    for (double& at : of) {
      const auto loss = [&](double value) {
        at = value;
        const auto y = ref::patch_embed(images, z, weight, bias, position);
        double sum = 0;
        for (std::size_t i = 0; i < y.size(); ++i) sum += dtokens[i] * y[i];
        return sum;
      };
      const double before = at;
      out.push_back(loss(before + 0.5) - loss(before - 0.5));  // linear: any step does
      at = before;
    }
    return out;
  };
  const auto want = ref::patch_embed_backward(images, z, c, dtokens);
  EXPECT_TRUE(test::close(want.weight, slopes(weight), 1e-12));
  EXPECT_TRUE(test::close(want.bias, slopes(bias), 1e-12));
  EXPECT_TRUE(test::close(want.position, slopes(position), 1e-12));
}

class PatchEmbedGradient : public test::FlavourTest {};
VSPLAT_FLAVOURS(PatchEmbedGradient);

TEST_P(PatchEmbedGradient, MatchesReference) {
  for (const auto& [z, c] : kPatchEmbedSizes) {
    SCOPED_TRACE(patch_embed_text(z, c));
    const auto images = test::random_floats(z.v * z.height * z.width * 3, 1, 0, 1);
    const auto dtokens = test::random_floats(z.v * z.tokens() * c, 2);
    const auto some_weight = test::random_floats(c * 3 * z.p * z.p, 3), some_bias = test::random_floats(c, 4);
    const long channels = static_cast<long>(c), p = static_cast<long>(z.p);
    const PatchEmbedBackward a{ctx().upload(shape_of_pictures(z), images),
                               static_cast<int>(z.p),
                               ctx().upload(shape_of_tokens(z, c), dtokens),
                               ctx().upload({channels, 3, p, p}, some_weight),
                               ctx().upload({channels}, some_bias),
                               ctx().upload({static_cast<long>(z.rows()), channels}, test::nans(z.rows() * c))};
    patch_embed_backward(ctx(), a);
    auto want = ref::patch_embed_backward(images, z, c, std::vector<double>(dtokens.begin(), dtokens.end()));
    for (std::size_t i = 0; i < some_weight.size(); ++i) want.weight[i] += some_weight[i];
    for (std::size_t i = 0; i < c; ++i) want.bias[i] += some_bias[i];
    EXPECT_TRUE(test::close(ctx().read<float>(a.dweight), want.weight, 1e-5));
    EXPECT_TRUE(test::close(ctx().read<float>(a.dbias), want.bias, 1e-5));
    EXPECT_TRUE(test::close(ctx().read<float>(a.dposition), want.position, 1e-6));
  }
}

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
