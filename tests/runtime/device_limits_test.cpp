// VSPLAT_LIMITS lowers the limits that a device reports, and never raises them.
#include "runtime/device_limits.h"

#include <gtest/gtest.h>

#include "tests/support/device.h"
#include "tests/support/refusal.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

DeviceInfo large() {
  DeviceInfo d;
  d.name = "large";
  d.memory = 1ull << 40, d.max_alloc = 1ull << 38, d.local_memory = 64 << 10, d.max_work_group = 1024;
  d.fp16 = d.fp64 = d.subgroups = true;
  d.matrix_units = {MatrixUnit::ptx};
  return d;
}

TEST(DeviceLimits, LowerWhatIsClaimed) {
  DeviceInfo d = large();
  lower(d,
        "group=128,local=16K,buffer=128M,memory=2G,align=4096,size=32,fp64=0,fp16=0,subgroups=0,matrix=0,flops=1.5e8,"
        "grid=7");
  EXPECT_EQ(d.max_work_group, 128u);
  EXPECT_EQ(d.local_memory, 16384u);
  EXPECT_EQ(d.max_alloc, 128u << 20);
  EXPECT_EQ(d.memory, 2ull << 30);
  EXPECT_EQ(d.align, 512);
  EXPECT_EQ(d.address_bits, 32);
  EXPECT_FALSE(d.fp64 || d.fp16 || d.subgroups);
  EXPECT_TRUE(d.matrix_units.empty());
  EXPECT_EQ(d.most_flops, 1.5e8);
  EXPECT_EQ(d.most_groups, 7u);
  EXPECT_EQ(d.lowered.substr(0, 9), "group=128");
}

TEST(DeviceLimits, RaiseNothing) {
  DeviceInfo d = large();
  lower(d, "group=4096,local=1G,buffer=1000G,memory=4096G,align=8,size=64,flops=1e18,grid=1000000");
  const DeviceInfo before = large();
  EXPECT_EQ(d.max_work_group, before.max_work_group);
  EXPECT_EQ(d.local_memory, before.local_memory);
  EXPECT_EQ(d.max_alloc, before.max_alloc);
  EXPECT_EQ(d.memory, before.memory);
  EXPECT_EQ(d.align, before.align);
  EXPECT_EQ(d.address_bits, before.address_bits);
  EXPECT_EQ(d.most_flops, before.most_flops);
  EXPECT_EQ(d.most_groups, before.most_groups);
  DeviceInfo same = large();
  lower(same, "");
  EXPECT_EQ(same.lowered, "");
  DeviceInfo little = large();  // a smaller memory has smaller buffers
  lower(little, "memory=1G");
  EXPECT_EQ(little.max_alloc, 1ull << 30);
}

TEST(DeviceLimits, WhatIsNotUnderstoodIsNamed) {
  const char* wrong[] = {"group",     "group=",     "group=0",    "group=-1",   "group=1.5", "group=12x", "group=16KK",
                         "local=nan", "locals=16K", "fp64=1",     "align=100",  "align=12",  "size=16",   "size=0",
                         "flops=0",   "flops=inf",  "group=128,", ",group=128", "memory=1T", "=5",        "grid=1e999"};
  for (const std::string text : wrong) {
    DeviceInfo d = large();
    const std::string said = test::refusal([&] { lower(d, text); }, Status::usage);
    EXPECT_NE(said.find("VSPLAT_LIMITS"), std::string::npos) << text;
    EXPECT_NE(said.find("group=ITEMS"), std::string::npos) << text;
  }
  const test::Variable wrongly("VSPLAT_LIMITS", "loca=16K");
  test::expect_error(Status::usage, {"\"loca=16K\"", "no such limit"}, [] { (void)list_devices(); });
}

TEST(DeviceLimits, WhatIsTooSmallIsRefusedWhenItIsOpened) {
  for (const char* text : {"group=63", "local=16383"}) {
    const test::Variable limits("VSPLAT_LIMITS", text);
    test::expect_error(Status::device, {"VSPLAT_LIMITS", "are needed"}, [] { (void)test::open_context(Flavour::cpu); });
  }
  const test::Variable limits("VSPLAT_LIMITS", "group=64,local=16K");
  EXPECT_EQ(test::open_context(Flavour::gpu)->device().max_work_group, 64u);
}

TEST(DeviceLimits, MemoryThatAnAddressDoesNotReachIsNotUsed) {
  const test::Variable limits("VSPLAT_LIMITS", "size=32");
  ContextOptions options;
  options.max_memory_gib = 64;
  const auto ctx = test::open_context(Flavour::cpu, options);
  EXPECT_LT(ctx->memory().limits().total, std::size_t{1} << 32);
  EXPECT_LE(ctx->memory().limits().max_alloc, ctx->memory().limits().total);
}

TEST(DeviceLimits, PiecesOfMemoryBeginWhereTheyMay) {
  const test::Variable limits("VSPLAT_LIMITS", "align=65536");
  const auto ctx = test::open_context(Flavour::cpu);
  const std::vector<Tensor> three{ctx->tensor({1}), ctx->tensor({1}), ctx->tensor({1})};
  for (const Tensor& one : three) EXPECT_EQ(one.block()->offset() % 8192, 0u);
}

}  // namespace
}  // namespace vsplat
