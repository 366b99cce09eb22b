#include "runtime/context.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "runtime/opencl.h"
#include "runtime/profile/profiler.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using test::open_context;

TEST(Context, WritesAndReadsBack) {
  Context& ctx = test::context(Flavour::cpu);
  const auto data = test::random_floats(1000, 1);
  const Tensor t = ctx.upload({10, 100}, data);
  EXPECT_EQ(ctx.read<float>(t), data);
  const Tensor copy = ctx.tensor({1000});
  ctx.copy(t, copy);
  EXPECT_EQ(ctx.read<float>(copy), data);
  ctx.fill_zero(copy);
  EXPECT_EQ(ctx.read<float>(copy), std::vector<float>(1000, 0.0f));
}

TEST(Context, ReusesMemoryAndReportsPeak) {
  auto ctx = open_context(Flavour::cpu);
  const std::size_t mib = 1 << 20;
  {
    const Tensor a = ctx->tensor({8, mib / 4});
    const Tensor b = ctx->tensor({8, mib / 4});
    EXPECT_EQ(ctx->memory().live(), 16 * mib);
  }
  EXPECT_EQ(ctx->memory().live(), 0u);
  const Tensor c = ctx->tensor({8, mib / 4});
  EXPECT_EQ(ctx->memory().reserved(), 16 * mib);
  EXPECT_EQ(ctx->memory().peak_live(), 16 * mib);
}

TEST(Context, DevicesAreFoundByAnyName) {
  std::vector<DeviceInfo> all(3);
  for (int i = 0; i < 3; ++i) all[static_cast<std::size_t>(i)].index = i;
  all[0].name = "pthread-AMD EPYC", all[0].platform_name = "Portable Computing Language", all[0].type = DeviceType::cpu;
  all[1].name = "gfx90a", all[1].vendor = "Advanced Micro Devices, Inc.", all[1].platform = 1;
  all[1].platform_name = "AMD Accelerated Parallel Processing", all[1].type = DeviceType::gpu;
  all[2].name = "llvmpipe (LLVM 15)", all[2].platform_name = "rusticl", all[2].platform = 2, all[2].device = 1;
  all[2].type = DeviceType::cpu;
  const auto found = [&](const std::string& spec) {
    std::string out;
    for (const DeviceInfo& d : that_match(spec, all)) out += std::to_string(d.index);
    return out;
  };
  EXPECT_EQ(found("1"), "1");
  EXPECT_EQ(found("3"), "");
  EXPECT_EQ(found("2:1"), "2");
  EXPECT_EQ(found("2:0"), "");
  EXPECT_EQ(found("cpu"), "02");
  EXPECT_EQ(found("gpu"), "1");
  EXPECT_EQ(found("Rusticl"), "2");
  EXPECT_EQ(found("portable"), "0");
  EXPECT_EQ(found("micro devices"), "1");
  EXPECT_EQ(found("amd"), "01");  // the caller reports the ambiguity
  EXPECT_EQ(found("intel"), "");
}

// A stream has its own memory within the device's limit, and its launches read what the device has computed.
TEST(Context, StreamsShareADevice) {
  auto ctx = open_context(Flavour::cpu);
  const auto stream = ctx->stream();
  const auto data = test::random_floats(1000, 1);
  const Tensor made = ctx->upload({1000}, data);
  ctx->finish();
  const Tensor copy = stream->tensor({1000});
  stream->copy(made, copy);
  EXPECT_EQ(stream->read<float>(copy), data);
  EXPECT_GT(stream->memory().reserved(), 0u);
  const std::size_t limit = ctx->memory().limits().total, used = ctx->memory().reserved();
  EXPECT_EQ(stream->planner()->memory().limits().total, limit - used);
  ctx.reset();  // it may be closed before its stream
  EXPECT_EQ(stream->planner()->memory().limits().total, limit - used) << "its tensor still lives";
  EXPECT_EQ(stream->read<float>(made), data);
}

// write() takes small data along without a wait, also more than it keeps, and before and after large data.
TEST(Context, WrittenDataMayChangeAtOnce) {
  auto ctx = open_context(Flavour::cpu);
  constexpr long small = 15000, many = 100, middle = many / 2;
  const Tensor large = ctx->tensor({4 * small});
  std::vector<Tensor> tensors;
  std::vector<float> data(4 * small);
  for (long i = 0; i < many; ++i) {
    std::fill(data.begin(), data.end(), static_cast<float>(i));
    tensors.push_back(ctx->tensor({small}));
    ctx->write(tensors.back(), data.data());
    if (i == middle) ctx->write(large, data.data());
  }
  std::fill(data.begin(), data.end(), -1.0f);
  for (long i = 0; i < many; ++i) EXPECT_EQ(ctx->read<float>(tensors[i]), std::vector<float>(small, i)) << i;
  EXPECT_EQ(ctx->read<float>(large), std::vector<float>(4 * small, static_cast<float>(middle)));
}

// Some drivers return from clFinish() at once if everything was flushed.
TEST(Context, FinishesWhatWasFlushed) {
  auto ctx = open_context(Flavour::cpu);
  const Tensor from = ctx->tensor({16 << 20}), to = ctx->tensor({16 << 20});
  ctx->fill_zero(from);
  for (int i = 0; i < 8; ++i) ctx->copy(from, to);
  const cl::Event done(static_cast<cl_event>(ctx->mark()));  // flushes
  ctx->finish();
  EXPECT_EQ(done.getInfo<CL_EVENT_COMMAND_EXECUTION_STATUS>(), CL_COMPLETE);
}

TEST(Context, StopsWhatIsAskedToStop) {
  auto ctx = open_context(Flavour::cpu);
  const auto data = test::random_floats(10, 1);
  const Tensor t = ctx->upload({10}, data);
  ctx->cancel();
  {
    const Uncancelled whole(*ctx);
    EXPECT_EQ(ctx->read<float>(t), data);
  }
  test::expect_error(Status::cancelled, {}, [&] { ctx->fill_zero(t); });
  ctx->go_on();
  EXPECT_EQ(ctx->read<float>(t), data);
}

// The plan predicts the run exactly: the same allocations, in slabs that are made in advance.
TEST(Context, PlanPredictsTheRun) {
  auto ctx = open_context(Flavour::cpu);
  const Tensor weights = ctx->tensor({1000, 1000});
  const auto work = [](Context& c) {
    const Stage stage(c, "encoder");
    Tensor kept = c.tensor({300000});
    for (int i = 1; i < 20; ++i) {
      const Tensor a = c.tensor({i * 50000L});
      const Tensor b = c.tensor({1000000 - i * 30000L});
      kept = c.tensor({300000 + i});
    }
    return kept;
  };
  auto plan = ctx->planner();
  work(*plan);
  ctx->memory().commit(plan->memory());
  const std::size_t reserved = ctx->memory().reserved();
  EXPECT_EQ(plan->memory().peak(), reserved);
  const Tensor kept = work(*ctx);
  EXPECT_EQ(ctx->memory().reserved(), reserved);
  EXPECT_EQ(ctx->memory().peak_live(), plan->memory().peak_live());
  EXPECT_EQ(ctx->stage_memory().back().stage, "encoder");
}

// Some drivers claim to report event times but return a nanosecond for each; then the host's clock is used.
TEST(Context, ProfilesTimesThatCanBe) {
  auto ctx = open_context(Flavour::cpu);
  const long n = 64;
  const Tensor out = ctx->tensor({n, 16});
  const Cost cost{2.0 * 16 * 8 * 20000 * n, 0};
  const auto run = [&] {
    ctx->launch({"peak", "peak_fma", "-DWIDTH=16 -DCHAINS=8"}, items(n, 1), cost, 20000, 0.9f, written(out));
    ctx->finish();
  };
  run();  // compiles
  ctx->profiler().enable(true);
  for (int i = 0; i < 3; ++i) run();
  ASSERT_EQ(ctx->profiler().rows().size(), 1u);
  const ProfileRow row = ctx->profiler().rows()[0];
  EXPECT_EQ(row.calls, 3u);
  const double seconds = static_cast<double>(row.total_ns) * 1e-9;
  EXPECT_LT(row.flops / seconds, 1e15) << "faster than any device, by the clock of the " << row.timed_by;
  EXPECT_LE(seconds, 1.01 * ctx->profiler().wall_seconds());
}

TEST(Context, RefusesMoreMemoryThanAllowed) {
  ContextOptions options;
  options.max_memory_gib = 0.01;
  auto ctx = open_context(Flavour::cpu, options);
  test::expect_error(Status::memory, {"the volume"}, [&] { ctx->tensor({100, 1000, 1000}, Type::f32, "the volume"); });
  EXPECT_EQ(ctx->memory().live(), 0u);
}

TEST(Context, UnknownDeviceIsAnErrorThatListsWhatThereIs) {
  ContextOptions options;
  options.device = "no such device";
  test::expect_error(Status::device, {list_devices().front().name}, [&] { const Context ctx(options); });
}

TEST(Context, EveryWayToNameADeviceFindsIt) {
  for (const DeviceInfo& d : list_devices()) {
    EXPECT_EQ(choose_device(std::to_string(d.index)).index, d.index);
    EXPECT_EQ(choose_device(fmt::format("{}:{}", d.platform, d.device)).index, d.index);
    EXPECT_EQ(choose_device(name_of(d.type)).type, d.type);
    EXPECT_NE(choose_device(d.name.substr(1, 6)).name.find(d.name.substr(1, 6)), std::string::npos);
  }
}

}  // namespace
}  // namespace vsplat
