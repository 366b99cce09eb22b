// DINOv3's encoder by itself, every stage of it and every gradient, against the PyTorch specification's vectors: square
// pictures, wide and high ones, with biases and rounded periods.
#include <gtest/gtest.h>

#include "model/networks/layers/vit.h"
#include "model/networks/params/params.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/extension_golden.h"
#include "tests/support/vectors.h"

namespace vsplat {
namespace {

using test::ExtensionGolden;

std::vector<std::string> encoder_vectors(const std::vector<std::string>& sizes) {
  std::vector<std::string> out;
  for (const std::string& size : sizes)
    for (const char* part : {"_square", "_wide", "_bias"}) out.push_back("dinov3_" + size + part);
  return out;
}
class Dinov3 : public test::VectorsTest {};
VSPLAT_VECTORS(Dinov3, encoder_vectors({"micro", "tiny"}));
VSPLAT_SLOW_VECTORS(Dinov3, encoder_vectors({"tiny_seed1", "tiny_seed2"}));

// Converts from [V, T, 3, H, D] to the specification's [V, H, T, D].
std::vector<float> part_of(const std::vector<float>& qkv, const Shape& shape, long which) {
  std::vector<float> out;
  const long t = shape[1], h = shape[3], d = shape[4];
  for (long v = 0; v < shape[0]; ++v)
    for (long head = 0; head < h; ++head)
      for (long token = 0; token < t; ++token) {
        const auto* at = qkv.data() + (((v * t + token) * 3 + which) * h + head) * d;
        out.insert(out.end(), at, at + d);
      }
  return out;
}

TEST_P(Dinov3, EveryStageAndGradientMatches) {
  VSPLAT_NEED_GOLDEN(name());
  const ExtensionGolden golden(name(), "encoder.model.");
  const EncoderSizes sizes = golden.config().encoder_sizes();
  const LearntWeights learnt(ctx(), golden.parameters(), golden.weights());
  const Vit vit(ctx(), sizes, learnt);
  const auto expect = [&](const std::vector<float>& got, const std::string& stage) {
    EXPECT_TRUE(test::close(got, golden.floats("stage." + stage), 1e-4)) << stage;
  };
  Vit::Saved saved;
  const Tensor images = golden.upload(ctx(), "input.images");
  const Tensor tokens = vit.forward(ctx(), images, &saved);
  expect(ctx().read<float>(tokens), "normed");
  expect(ctx().read<float>(saved.blocks[0].x), "tokens");
  for (std::size_t i = 0; i < saved.blocks.size(); ++i) {
    const std::string block = "block" + std::to_string(i) + ".";
    const BlockSaved& s = saved.blocks[i];
    const auto qkv = ctx().read<float>(s.qkv);
    for (const auto& [part, which] : {std::pair{"q", 0L}, {"k", 1L}, {"v", 2L}})
      expect(part_of(qkv, s.qkv.shape(), which), block + part);
    expect(ctx().read<float>(s.middle), block + "middle");
    expect(ctx().read<float>(i + 1 < saved.blocks.size() ? saved.blocks[i + 1].x : saved.last), block + "out");
  }
  // A Vit made for inference gives the same result.
  const Vit plain(ctx(), sizes, golden.weights());
  expect(ctx().read<float>(plain.forward(ctx(), images)), "normed");

  // The class token and the registers are dropped, so their gradient is zero.
  const Shape shape = golden.tensor("cotangent.features").shape;
  const auto by_features = golden.floats("cotangent.features");
  const long v = tokens.dim(0), t = tokens.dim(1), c = tokens.dim(2), p = sizes.prefix();
  std::vector<float> dtokens(static_cast<std::size_t>(tokens.count()), 0.0f);
  for (long view = 0; view < v; ++view)
    std::copy_n(by_features.begin() + view * (t - p) * c, (t - p) * c, dtokens.begin() + (view * t + p) * c);
  const Tensor dy = ctx().upload(tokens.shape(), dtokens);
  vit.backward(ctx(), saved, dy);
  int compared = 0;
  std::map<std::string, std::vector<float>> first;
  for (const auto& [weight, bare] : golden.names()) {
    first[weight] = ctx().read<float>(learnt.at(weight).gradient);
    EXPECT_TRUE(test::close(first[weight], golden.floats("cograd." + bare), 1e-4)) << bare;
    ++compared;
  }
  EXPECT_EQ(compared, 6 + sizes.vit_depth * (13 + (sizes.qkv_bias ? 2 : 0)));
  // Gradients are added to, and have the same bits again.
  learnt.zero_gradients(ctx());
  vit.backward(ctx(), saved, dy);
  for (const auto& [weight, values] : first) EXPECT_EQ(ctx().read<float>(learnt.at(weight).gradient), values) << weight;
}

}  // namespace
}  // namespace vsplat
