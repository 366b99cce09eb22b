#include "model/ops/patch_embed.h"

#include <fmt/format.h>

#include "tests/reference/patch_embed.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

class PatchEmbed : public test::FlavourTest {};
VSPLAT_FLAVOURS(PatchEmbed);

TEST_P(PatchEmbed, MatchesTheConvolution) {
  struct PatchEmbedSize {
    long v, s, p, c;
  };
  for (const PatchEmbedSize& n :
       {PatchEmbedSize{1, 1, 1, 1}, {2, 6, 3, 7}, {3, 21, 7, 12}, {1, 48, 16, 33}, {2, 34, 17, 5}}) {
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

// What the backward kernels are held against is itself held against differences of what the forward ones are.
TEST(PatchEmbedReference, GradientsAreThoseOfDifferences) {
  const std::size_t v = 2, s = 4, p = 2, c = 3, tokens = 5;
  const auto doubles = [](const std::vector<float>& values) {
    return std::vector<double>(values.begin(), values.end());
  };
  const auto images = test::random_floats(v * s * s * 3, 1, 0, 1);
  auto weight = doubles(test::random_floats(c * 3 * p * p, 2)), bias = doubles(test::random_floats(c, 3));
  auto position = doubles(test::random_floats(tokens * c, 4));
  const auto dtokens = doubles(test::random_floats(v * tokens * c, 5));
  const auto slopes = [&](std::vector<double>& of) {
    std::vector<double> out;
    for (double& at : of) {
      const auto loss = [&](double value) {
        at = value;
        const auto y = ref::patch_embed(images, v, s, p, weight, bias, position);
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
  const auto want = ref::patch_embed_backward(images, v, s, p, c, dtokens);
  EXPECT_TRUE(test::close(want.weight, slopes(weight), 1e-12));
  EXPECT_TRUE(test::close(want.bias, slopes(bias), 1e-12));
  EXPECT_TRUE(test::close(want.position, slopes(position), 1e-12));
}

class PatchEmbedGradient : public test::FlavourTest {};
VSPLAT_FLAVOURS(PatchEmbedGradient);

TEST_P(PatchEmbedGradient, MatchesReference) {
  struct PatchEmbedSize {
    long v, s, p, c;
  };
  for (const PatchEmbedSize& n :
       {PatchEmbedSize{1, 1, 1, 1}, {2, 6, 3, 7}, {3, 21, 7, 12}, {1, 48, 16, 33}, {2, 34, 17, 5}, {4, 36, 3, 65}}) {
    SCOPED_TRACE(fmt::format("{} pictures of {}, patches of {}, {} channels", n.v, n.s, n.p, n.c));
    const auto v = static_cast<std::size_t>(n.v), s = static_cast<std::size_t>(n.s), p = static_cast<std::size_t>(n.p),
               c = static_cast<std::size_t>(n.c), tokens = 1 + (s / p) * (s / p);
    const auto images = test::random_floats(v * s * s * 3, 1, 0, 1);
    const auto dtokens = test::random_floats(v * tokens * c, 2);
    const auto some_weight = test::random_floats(c * 3 * p * p, 3), some_bias = test::random_floats(c, 4);
    const auto rows = static_cast<long>(tokens);
    const PatchEmbedBackward a{
        ctx().upload({n.v, n.s, n.s, 3}, images), static_cast<int>(n.p),
        ctx().upload({n.v, rows, n.c}, dtokens),  ctx().upload({n.c, 3, n.p, n.p}, some_weight),
        ctx().upload({n.c}, some_bias),           ctx().upload({rows, n.c}, test::nans(tokens * c))};
    patch_embed_backward(ctx(), a);
    auto want = ref::patch_embed_backward(images, v, s, p, c, std::vector<double>(dtokens.begin(), dtokens.end()));
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
