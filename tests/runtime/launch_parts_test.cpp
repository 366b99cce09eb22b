// Long launches are split: each group runs once, no part is too long, and results have the same bits.
#include "runtime/launch_parts.h"

#include <gtest/gtest.h>

#include <map>

#include "runtime/gemm.h"
#include "runtime/profile/profiler.h"
#include "runtime/program.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

constexpr KernelId kernel{"none", "none", {}};

DeviceInfo small(double flops, std::size_t groups) {
  DeviceInfo d;
  d.name = "small";
  d.most_flops = flops, d.most_groups = groups;
  return d;
}

// How often each group is launched; every part must consist of whole groups.
std::map<std::array<std::size_t, 3>, int> covered(const std::vector<LaunchPart>& parts, const Range& range) {
  std::map<std::array<std::size_t, 3>, int> out;
  for (const LaunchPart& part : parts) {
    std::array<std::size_t, 3> begin{}, end{};
    for (std::size_t d = 0; d < 3; ++d) {
      const std::size_t size = std::max<std::size_t>(range.local[d], 1);
      EXPECT_EQ(part.offset[d] % size, 0u);
      EXPECT_EQ(part.global[d] % size, 0u);
      begin[d] = part.offset[d] / size, end[d] = begin[d] + part.global[d] / size;
    }
    for (std::size_t z = begin[2]; z < end[2]; ++z)
      for (std::size_t y = begin[1]; y < end[1]; ++y)
        for (std::size_t x = begin[0]; x < end[0]; ++x) ++out[{x, y, z}];
  }
  return out;
}

TEST(LaunchParts, HaveEachGroupOnceAndNoneIsTooLong) {
  for (const double flops : {1.0, 999.0, 1e4, 3.7e4, 1e5, 1e9})
    for (const std::size_t grid : {1ul, 2ul, 5ul, 7ul, 100ul}) {
      const Range range = groups(11, 64, 13, 7);
      const DeviceInfo device = small(flops, grid);
      const std::vector<LaunchPart> parts = parts_of(kernel, range, {1e5, 10, 0, 0}, device);
      const auto times = covered(parts, range);
      ASSERT_EQ(times.size(), 11u * 13 * 7);
      Cost sum;
      for (const auto& [group, count] : times) ASSERT_EQ(count, 1);
      for (const LaunchPart& part : parts) {
        sum.flops += part.cost.flops, sum.bytes += part.cost.bytes;
        ASSERT_LE(part.global[1], grid);
        ASSERT_LE(part.global[2], grid);
        const bool is_a_group = part.global == range.local;
        // Parts of one launch may differ by one group in each direction.
        ASSERT_TRUE(is_a_group || part.cost.flops <= 2 * flops) << part.cost.flops << " of " << flops;
      }
      ASSERT_NEAR(sum.flops, 1e5, 1e-6);
      ASSERT_NEAR(sum.bytes, 10, 1e-9);
    }
}

TEST(LaunchParts, AreOneWhereNothingAsksForMore) {
  const Range range = items(1000);
  EXPECT_EQ(parts_of(kernel, range, {2e10, 0, 0, 0}, DeviceInfo()).size(), 1u);
  EXPECT_EQ(parts_of(kernel, range, {2.1e10, 0, 0, 0}, DeviceInfo()).size(), 2u);
  EXPECT_EQ(parts_of(kernel, range, {8e10, 0, 2e10, 0}, DeviceInfo()).size(), 1u) << "what is performed counts";
  EXPECT_EQ(parts_of(kernel, range, {0, 0, 0, 8e10}, DeviceInfo()).size(), 4u) << "so does what may come of it";
  EXPECT_EQ(parts_of(kernel, range, {0, 8e9, 0, 0}, DeviceInfo()).size(), 4u) << "and what moves";
  EXPECT_EQ(parts_of(kernel, groups(1, 64, 65535, 65535), {}, DeviceInfo()).size(), 1u);
  EXPECT_EQ(parts_of(kernel, groups(1, 64, 65536), {}, DeviceInfo()).size(), 2u);
  EXPECT_EQ(parts_of(kernel, groups(100000, 64), {}, DeviceInfo()).size(), 1u);
}

TEST(LaunchParts, IndicesBeyondADevicesSizesAreRefused) {
  DeviceInfo device;
  device.address_bits = 32;
  EXPECT_EQ(parts_of(kernel, items((1L << 32) - 64), {}, device).size(), 1u);
  test::expect_error(Status::memory, {"none: 4294967296 work-items", "32 bits"},
                     [&] { (void)parts_of(kernel, items(1L << 32), {}, device); });
  // The same in a plan, which launches nothing.
  const test::Variable limits("VSPLAT_LIMITS", "size=32");
  const auto planner = test::open_context(Flavour::cpu)->planner();
  test::expect_error(Status::memory, {"32 bits"}, [&] { planner->launch(kernel, items(1L << 32), {}); });
}

// All ways in which a kernel can query its group, in all directions.
TEST(LaunchParts, KernelsKnowTheirPlace) {
  const test::TemporaryFolder folder;
  test::put_file(folder / "common.clh", kernel_text("common.clh"));
  test::put_file(folder / "place.cl",
                 "#include \"common.clh\"\n"
                 "kernel void place(global int* out, int X, int Y) {\n"
                 "  const int x = GROUP_ID(0), y = GROUP_ID(1), z = GROUP_ID(2), size = get_local_size(0);\n"
                 "  if (get_global_id(0) != x * size + get_local_id(0)) return;\n"
                 "  if (get_global_id(1) != y || get_global_id(2) != z) return;\n"
                 "  out[((z * Y + y) * X + x) * size + get_local_id(0)] += 1 + x + 100 * y + 10000 * z;\n"
                 "}\n");
  const test::Variable kernels("VSPLAT_KERNEL_DIR", folder.path().c_str());
  for (const char* text : {"", "grid=3", "flops=5", "flops=100,grid=4"}) {
    const test::Variable limits("VSPLAT_LIMITS", text);
    const auto ctx = test::open_context(Flavour::gpu);
    const Tensor out = ctx->tensor({7, 9, 5, 4}, Type::i32);
    ctx->fill_zero(out);
    ctx->profiler().enable(true);
    ctx->launch({"place", "place", ""}, groups(5, 4, 9, 7), {315, 0, 0, 0}, written(out), 5, 9);
    ctx->finish();
    ctx->profiler().enable(false);
    EXPECT_EQ(ctx->profiler().profile().launches.size() > 1, *text != 0);
    const std::vector<int> got = ctx->read<int>(out);
    for (int i = 0; i < 7 * 9 * 5 * 4; ++i)
      ASSERT_EQ(got[static_cast<std::size_t>(i)], 1 + i / 4 % 5 + 100 * (i / 20 % 9) + 10000 * (i / 180)) << text;
  }
}

// Products in parts, and in groups of every size, have the same bits as whole ones.
class Variants : public test::FlavourTest {};

std::vector<float> product(Flavour flavour, const char* text) {
  const test::Variable limits("VSPLAT_LIMITS", text);
  const auto ctx = test::open_context(flavour);
  const long m = 301, n = 197, k = 83;
  const auto a = test::random_floats(static_cast<std::size_t>(m * k), 1),
             b = test::random_floats(static_cast<std::size_t>(k * n), 2);
  const PackedMatrix packed = pack_matrix(*ctx, b.data(), k, n, n, 1, "b");
  Gemm g;
  g.a.x0 = ctx->upload({m, k}, a);
  g.b = &packed;
  g.out = ctx->tensor({m, n});
  gemm(*ctx, g);
  std::vector<float> out = ctx->read<float>(g.out);
  const Tensor back = ctx->tensor({k, n});
  transposed_gemm(*ctx, {g.a.x0, g.out, back});
  const std::vector<float> more = ctx->read<float>(back);
  out.insert(out.end(), more.begin(), more.end());
  return out;
}

TEST_P(Variants, HaveTheSameBits) {
  const std::vector<float> whole = product(GetParam(), "");
  for (const char* text : {"flops=1e5", "grid=1", "group=128", "group=64", "local=16K", "group=64,local=16K,flops=3e4"})
    EXPECT_EQ(product(GetParam(), text), whole) << text;
}
VSPLAT_FLAVOURS(Variants);

}  // namespace
}  // namespace vsplat
