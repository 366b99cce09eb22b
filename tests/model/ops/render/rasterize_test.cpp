#include "model/ops/render/rasterize.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "model/diagnose/selftest/reference/rasterize.h"
#include "tests/support/counted.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class Rasterize : public test::FlavourTest {
 protected:
  struct Case {
    std::vector<float> records;
    std::vector<std::uint32_t> ids, starts;
  };

  // `per_tile` records near each tile, of sizes from a pixel to the tile; alpha keeps away from its thresholds'
  // neighbourhood only by chance, so a few pixels may flip: none does for these seeds.
  Case make(int width, int height, int per_tile, float opacity, std::uint32_t seed) {
    std::mt19937 engine(seed);
    std::uniform_real_distribution<float> uniform;
    Case c;
    const int tiles_x = (width + 15) / 16, tiles = tiles_x * ((height + 15) / 16);
    for (int tile = 0; tile < tiles; ++tile) {
      c.starts.push_back(static_cast<std::uint32_t>(c.ids.size()));
      if (tile % 5 == 4) continue;  // some see nothing
      for (int i = 0; i < per_tile; ++i) {
        const float u = static_cast<float>(tile % tiles_x * 16) + 20 * uniform(engine) - 2;
        const float v = static_cast<float>(tile / tiles_x * 16) + 20 * uniform(engine) - 2;
        const float a = 0.5f + 40 * uniform(engine), d = 0.4f + 10 * uniform(engine), k = 2 * uniform(engine) - 1;
        const float o = opacity * (0.5f + 0.5f * uniform(engine));
        const float vertical = d + k * k * a, reach = std::sqrt(2 * vertical * std::log(255 * o)) + 0.1f;
        c.ids.push_back(static_cast<std::uint32_t>(c.records.size() / 12));
        const float log2e = 1.4426950409f;
        for (const float f :
             {u, v, reach, 1 + static_cast<float>(i), std::log2(o), k, -0.5f * log2e / a, -0.5f * log2e / d})
          c.records.push_back(f);
        for (int j = 0; j < 3; ++j) c.records.push_back(2 * uniform(engine));
        c.records.push_back(0);
      }
    }
    c.starts.push_back(static_cast<std::uint32_t>(c.ids.size()));
    return c;
  }

  // Starts as NaN, so that what is not drawn shows.
  DevicePicture draw(const Projected& p, const Binned& b, const Part& part, int width, int height,
                     const std::array<float, 3>& background) {
    const DevicePicture out = make_picture(ctx(), width, height);
    for (const Tensor& t : {out.colour, out.alpha, out.depth})
      ctx().write(t, std::vector<float>(static_cast<std::size_t>(t.count()), NAN).data());
    rasterize_forward(ctx(), {p, b, part, background, out});
    return out;
  }
};

// 0.99 twice leaves 0.0001 less a rounding: the second would bring transmittance under 1e-4 and is not drawn.
TEST_P(Rasterize, StopsBeforeTheThresholdIsPassed) {
  const std::vector<float> record{8, 8, 100, 2, 0, 0, -1e-9f, -1e-9f, 1, 1, 1, 0};
  std::vector<float> records;
  for (int i = 0; i < 3; ++i) records.insert(records.end(), record.begin(), record.end());
  Projected p;
  p.records = ctx().upload({3, 12}, records);
  Binned b;
  b.ids = ctx().upload({3}, std::vector<std::uint32_t>{0, 1, 2}, Type::u32);
  b.starts = ctx().upload({2}, std::vector<std::uint32_t>{0, 3}, Type::u32);
  const DevicePicture got = draw(p, b, {0, 0, 1, 1}, 16, 16, {0, 0, 0});
  for (const float a : ctx().read<float>(got.alpha)) EXPECT_EQ(a, 0.99f);
}

// In a profiled run its operations come of a counter; what is drawn is the same to the bit.
TEST_P(Rasterize, CountsWhatItBlendsInAProfiledRun) {
  const int width = 53, height = 40;
  const Case c = make(width, height, 300, 0.9f, 5);
  Projected p;
  p.records = ctx().upload({static_cast<long>(c.records.size() / 12), 12}, c.records);
  Binned b;
  b.ids = ctx().upload({static_cast<long>(c.ids.size())}, c.ids, Type::u32);
  b.starts = ctx().upload({static_cast<long>(c.starts.size())}, c.starts, Type::u32);
  const Part whole{0, 0, (width + 15) / 16, (height + 15) / 16};
  const DevicePicture plain = draw(p, b, whole, width, height, {0.25f, 0.5f, 1});
  DevicePicture counted;
  const auto again = [&] { counted = draw(p, b, whole, width, height, {0.25f, 0.5f, 1}); };
  const ProfileRow once = test::profiled_row(ctx(), "rasterize_forward", again);
  const ProfileRow twice = test::profiled_row(ctx(), "rasterize_forward", [&] { again(), ctx().finish(), again(); });
  EXPECT_EQ(ctx().read<float>(plain.colour), ctx().read<float>(counted.colour));
  EXPECT_EQ(ctx().read<float>(plain.alpha), ctx().read<float>(counted.alpha));
  EXPECT_EQ(ctx().read<float>(plain.depth), ctx().read<float>(counted.depth));
  const ref::Blended want = ref::blend(c.records, c.ids, c.starts, width, height, {0.25f, 0.5f, 1});
  EXPECT_EQ(once.counted, want.pairs);
  EXPECT_EQ(twice.counted, 2 * want.pairs);
  EXPECT_GT(once.flops, static_cast<double>(30 * want.pairs));
  EXPECT_EQ(twice.flops, 2 * once.flops);
  EXPECT_EQ(once.performed_flops, once.flops);
}

TEST_P(Rasterize, RejectsBadShape) {
  Projected p;
  p.records = ctx().tensor({3, 12});
  Binned b;
  b.ids = ctx().tensor({3}, Type::u32);
  b.starts = ctx().tensor({3}, Type::u32);
  const DevicePicture picture = make_picture(ctx(), 16, 16);
  EXPECT_THROW(rasterize_forward(ctx(), {p, b, {0, 0, 1, 1}, {0, 0, 0}, picture}), Error);
  b.starts = ctx().tensor({2}, Type::u32);
  EXPECT_THROW(rasterize_forward(ctx(), {p, b, {0, 1, 1, 2}, {0, 0, 0}, picture}), Error);
  p.records = ctx().tensor({3, 11});
  EXPECT_THROW(rasterize_forward(ctx(), {p, b, {0, 0, 1, 1}, {0, 0, 0}, picture}), Error);
}

VSPLAT_FLAVOURS(Rasterize);
VSPLAT_OPERATION(Rasterize, rasterize)

}  // namespace
}  // namespace vsplat
