// Faults planted in a kernel, and the checks that find them.
#include "runtime/launch_checks.h"

#include <gtest/gtest.h>

#include <limits>
#include <memory>

#include "tests/support/device.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

using test::Variable;

class LaunchChecks : public ::testing::Test {
 protected:
  LaunchChecks() : kernels_("VSPLAT_KERNEL_DIR", folder_.path().c_str()) {
    test::put_file(folder_ / "faulty.cl",
                   "kernel void put(global float* to, int at, float value) { to[at] = value; }\n"
                   "kernel void pass(global const float* from, global float* to) { to[0] = from[0]; }\n");
  }

  static std::unique_ptr<Context> open(const char* check, const char* arena) {
    const Variable a("VSPLAT_CHECK", check), b("VSPLAT_ARENA", arena);
    return test::open_context(Flavour::cpu);
  }
  // With red zones; null where the driver cannot take them.
  static std::unique_ptr<Context> guarded(const char* check = nullptr) {
    try {
      return open(check, "guard");
    } catch (const Error& e) {
      if (e.status() != Status::device) throw;
      return nullptr;
    }
  }
  static void put(Context& ctx, const Written& to, long at, float value) {
    ctx.launch({"faulty", "put", ""}, items(1, 1), {}, to, at, value);
  }
  static void expect_named(const std::string& message, const std::vector<std::string>& words) {
    for (const std::string& word : words) EXPECT_NE(message.find(word), std::string::npos) << word << ": " << message;
  }

  static constexpr const char* kNoRedZones = "VSPLAT_ARENA=guard is refused on this driver";
  static constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  static constexpr float infinity = std::numeric_limits<float>::infinity();

  test::TemporaryFolder folder_;

 private:
  Variable kernels_;
};

TEST_F(LaunchChecks, WhatIsNoIntIsRefused) {
  const auto ctx = open(nullptr, nullptr);
  const Tensor x = ctx->tensor({4});
  expect_named(test::refusal([&] { put(*ctx, written(x), 3000000000L, 1); }, Status::internal),
               {"put", "argument 1", "3000000000"});
  expect_named(test::refusal([&] { put(*ctx, written(x), -2147483649L, 1); }, Status::internal), {"-2147483649"});
}

TEST_F(LaunchChecks, NothingIsLookedAtUnlessAskedFor) {
  const auto ctx = open(nullptr, nullptr);
  const Tensor x = ctx->tensor({4}), behind = ctx->tensor({4});
  put(*ctx, written(x), 3, nan);
  put(*ctx, written(x), 4, 1);
}

TEST_F(LaunchChecks, FindsNan) {
  const auto ctx = open("nan", nullptr);
  const Tensor x = ctx->upload({2, 3}, std::vector<float>(6, 0.0f));
  put(*ctx, written(x), 5, infinity);
  expect_named(test::refusal([&] { put(*ctx, written(x), 4, nan); }, Status::internal),
               {"put", "argument 0", "f32 [2, 3]", "element 4", "[1, 1]", "1 of the 6"});
}

TEST_F(LaunchChecks, LooksForNanWhereValuesAre) {
  const auto ctx = open("nan", nullptr);
  const Tensor x = ctx->upload({6}, std::vector<float>(6, 0.0f));
  put(*ctx, written(x, 4), 4, nan);
  put(*ctx, written(x, 5, 1), 5, 1);
  put(*ctx, written_somewhere(x), 3, 1);
  expect_named(test::refusal([&] { put(*ctx, written(x, 3, 2), 3, 1); }, Status::internal), {"element 4"});
  expect_named(test::refusal([&] { put(*ctx, written(x, 3, 4), 3, 1); }, Status::internal), {"[3, 7)"});
}

TEST_F(LaunchChecks, WhatTheKernelMayWriteIsMarked) {
  const auto ctx = open("nan", nullptr);
  if (!ctx->device().is_pocl) return;  // other drivers may not report it
  const Tensor x = ctx->upload({1}, std::vector<float>(1, 0.0f)), y = ctx->tensor({1});
  const KernelId pass{"faulty", "pass", ""};
  ctx->launch(pass, items(1, 1), {}, x, written(y));
  expect_named(test::refusal([&] { ctx->launch(pass, items(1, 1), {}, x, y); }, Status::internal),
               {"pass", "argument 1", "f32 [1]"});
  expect_named(test::refusal([&] { ctx->launch(pass, items(1, 1), {}, written(x), written(y)); }, Status::internal),
               {"pass", "argument 0"});
}

TEST_F(LaunchChecks, FindsAFloatBesideATensor) {
  const auto ctx = guarded();
  if (!ctx) GTEST_SKIP() << kNoRedZones;
  // 12 bytes end within the piece that the arena allocates for them, 512 end with it.
  for (const long n : {3L, 128L}) {
    const Tensor before = ctx->tensor({4}), x = ctx->tensor({1, n}, Type::f32, "the tensor"), behind = ctx->tensor({4});
    put(*ctx, written(x), 0, 1);
    put(*ctx, written(x), n - 1, 1);
    expect_named(test::refusal([&] { put(*ctx, written(x), n, 1); }, Status::internal),
                 {"put", "the tensor", "f32 [1, " + std::to_string(n) + "]", "argument 0", "0 bytes behind its end",
                  "4 bytes of them"});
  }
  const Tensor x = ctx->tensor({3}), aside = ctx->tensor({5});
  expect_named(test::refusal([&] { put(*ctx, written(x), -2, 1); }, Status::internal),
               {"f32 [3]", "8 bytes before it", "4 bytes of them"});
}

TEST_F(LaunchChecks, ZonesOfOtherTensorsAreLookedAt) {
  const auto ctx = guarded();
  if (!ctx) GTEST_SKIP() << kNoRedZones;
  const Tensor x = ctx->tensor({64}), y = ctx->tensor({64}, Type::f32, "the neighbour");
  // The layout is x, its zone, y's zone, y: writes a float behind the end of y.
  const long far = static_cast<long>((y.block()->offset() - x.block()->offset()) / sizeof(float)) + 64;
  expect_named(test::refusal([&] { put(*ctx, written(x), far, 1); }, Status::internal),
               {"put", "the neighbour", "no argument of it", "0 bytes behind"});
}

// Reading beyond a tensor gives NaN.
TEST_F(LaunchChecks, ZonesAreNan) {
  const auto ctx = guarded("nan");
  if (!ctx) GTEST_SKIP() << kNoRedZones;
  const Tensor x = ctx->tensor({3, 3}), y = ctx->upload({1}, std::vector<float>(1, 0.0f));
  test::put_file(folder_ / "beyond.cl",
                 "kernel void sum(global const float* from, int n, global float* to) { to[0] += 2.0f * from[n]; }\n");
  expect_named(test::refusal(
                   [&] {
                     ctx->launch({"beyond", "sum", ""}, items(1, 1), {}, x, 9, written(y));
                   },
                   Status::internal),
               {"sum", "argument 2", "element 0"});
}

// With guards, plans match the memory used, and all of it is freed.
TEST_F(LaunchChecks, ZonesAreCounted) {
  const auto ctx = guarded();
  if (!ctx) GTEST_SKIP() << kNoRedZones;
  const auto work = [](Context& c) {
    const Tensor a = c.tensor({1000}), b = c.tensor({1 << 21});
    return c.tensor({7});
  };
  const auto plan = ctx->planner();
  work(*plan);
  ctx->memory().commit(plan->memory());
  const std::size_t reserved = ctx->memory().reserved();
  work(*ctx);
  EXPECT_EQ(ctx->memory().reserved(), reserved);
  EXPECT_EQ(ctx->memory().peak_live(), plan->memory().peak_live());
  EXPECT_EQ(ctx->memory().live(), 0u);
  EXPECT_TRUE(ctx->memory().guarded().empty());
}

TEST_F(LaunchChecks, UnknownWishesAreRefused) {
  expect_named(test::refusal([] { open("infinity", nullptr); }, Status::usage), {"VSPLAT_CHECK", "infinity", "nan"});
  expect_named(test::refusal([] { open(nullptr, "on"); }, Status::usage), {"VSPLAT_ARENA", "on", "guard"});
}

}  // namespace
}  // namespace vsplat
