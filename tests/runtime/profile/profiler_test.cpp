#include "runtime/profile/profiler.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "runtime/clock.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::open_context;

double at(const WallSplit& split, WallPart part) {
  return static_cast<double>(split.parts[static_cast<std::size_t>(part)]) * 1e-9;
}

void compute(Context& ctx, long n = 64) {
  const Tensor out = ctx.tensor({n, 16});
  const Cost cost{2.0 * 16 * 8 * 20000 * static_cast<double>(n), 0};
  ctx.launch({"peak", "peak_fma", "-DWIDTH=16 -DCHAINS=8"}, items(n, 1), cost, 20000, 0.9f, written(out));
}

void sleep(int milliseconds) { std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds)); }

TEST(Profiler, TheWallIsTheClocks) {
  auto ctx = open_context(Flavour::cpu);
  compute(*ctx);
  ctx->finish();
  const std::uint64_t before = now_ns();
  ctx->profiler().enable(true);
  const std::uint64_t on = now_ns();
  compute(*ctx);
  sleep(30);
  ctx->finish();  // device activity would take precedence over the host's
  {
    const HostSpan span(HostKind::file, "read", "a file");
    sleep(20);
  }
  ctx->finish();
  const std::uint64_t until = now_ns();
  const Profile profile = ctx->profiler().profile();
  const std::uint64_t passed = now_ns() - before;
  EXPECT_LE(wall_ns(profile), passed);
  EXPECT_GE(wall_ns(profile), until - on);
  const WallSplit split = split_wall(profile);
  EXPECT_EQ(sum_of(split.parts), wall_ns(profile));
  EXPECT_GT(at(split, WallPart::device), 0);
  EXPECT_GE(at(split, WallPart::file), 0.019);
}

// A launch lies between the host's calls around it.
TEST(Profiler, LaunchesLieOnTheHostsClock) {
  auto ctx = open_context(Flavour::cpu);
  compute(*ctx);
  ctx->finish();
  ctx->profiler().enable(true);
  std::vector<std::pair<std::uint64_t, std::uint64_t>> around;
  for (int i = 0; i < 5; ++i) {
    sleep(5);
    around.emplace_back(now_ns(), 0);
    compute(*ctx);
    ctx->finish();
    around.back().second = now_ns();
  }
  const Profile profile = ctx->profiler().profile();
  ASSERT_EQ(profile.launches.size(), around.size());
  constexpr std::uint64_t slack = 1'000'000;  // ns
  for (std::size_t i = 0; i < around.size(); ++i) {
    const ProfileLaunch& l = profile.launches[i];
    EXPECT_GE(l.queued + slack, around[i].first) << i;
    EXPECT_LE(l.end, around[i].second + slack) << i;
    EXPECT_LE(l.queued, l.submitted);
    EXPECT_LE(l.submitted, l.start);
    EXPECT_LE(l.start, l.end);
  }
}

TEST(Profiler, CompilingIsARowAndFirstLaunchesAreMarked) {
  auto ctx = open_context(Flavour::cpu);
  ctx->profiler().enable(true);
  for (int i = 0; i < 3; ++i) compute(*ctx);
  compute(*ctx, 7);
  ctx->finish();
  const Profile profile = ctx->profiler().profile();
  ASSERT_EQ(profile.rows.size(), 1u);
  const ProfileRow& row = profile.rows[0];
  EXPECT_EQ(row.calls, 4u);
  EXPECT_EQ(row.first_calls, 1u);
  EXPECT_LE(row.first_ns, row.total_ns);
  ASSERT_EQ(row.variants.size(), 2u);
  EXPECT_EQ(row.variants[0].calls, 3u);
  EXPECT_EQ(row.variants[0].shapes, "[64, 16]");
  EXPECT_EQ(row.variants[0].global[0], 64u);
  EXPECT_EQ(row.variants[0].local[0], 1u);
  EXPECT_EQ(row.variants[1].shapes, "[7, 16]");
  EXPECT_EQ(row.variants[0].total_ns + row.variants[1].total_ns, row.total_ns);
  EXPECT_EQ(row.variants[0].flops + row.variants[1].flops, row.flops);
  const auto compiles = std::count_if(profile.host.begin(), profile.host.end(), [](const HostRecord& r) {
    return r.kind == HostKind::compile && r.detail == "peak_fma";
  });
  EXPECT_EQ(compiles, 1);
}

// Time before a device is open counts, from the time given to begin() on, and only once.
TEST(Profiler, BeginsWhereItIsAsked) {
  HostLog::of_process().begin(now_ns());
  {
    const HostSpan span(HostKind::host, "before any device");
    sleep(20);
  }
  auto ctx = open_context(Flavour::cpu);
  ctx->profiler().enable(true);
  EXPECT_GE(ctx->profiler().wall_seconds(), 0.02);
  const Profile profile = ctx->profiler().profile();
  EXPECT_TRUE(std::any_of(profile.host.begin(), profile.host.end(),
                          [](const HostRecord& r) { return r.name == "before any device"; }));
  ctx->profiler().enable(false);
  ctx->profiler().reset();
  const std::uint64_t again = now_ns();
  ctx->profiler().enable(true);
  const std::uint64_t wall = wall_ns(ctx->profiler().profile());
  EXPECT_LE(wall, now_ns() - again);
}

TEST(Profiler, RecordsWhileItIsOnAlone) {
  auto ctx = open_context(Flavour::cpu);
  const auto spans = [&] { return ctx->profiler().profile().host.size(); };
  { const HostSpan span(HostKind::upload, "unseen"); }
  ctx->profiler().enable(true);
  { const HostSpan span(HostKind::upload, "seen"); }
  EXPECT_EQ(spans(), 1u);
  compute(*ctx);
  ctx->finish();
  ctx->profiler().enable(false);
  const std::uint64_t wall = wall_ns(ctx->profiler().profile());
  const std::size_t seen = spans();
  sleep(5);
  { const HostSpan span(HostKind::upload, "unseen"); }
  EXPECT_EQ(wall_ns(ctx->profiler().profile()), wall);
  EXPECT_EQ(spans(), seen);
  EXPECT_FALSE(HostLog::of_process().on());
}

// In a run with more spans than are stored, the enclosing span, which ends last, is still recorded.
TEST(Profiler, TheShortestOfTooManySpansAreForgotten) {
  HostLog& log = HostLog::of_process();
  log.hold();
  const std::uint64_t begun = now_ns();
  for (std::uint64_t i = 0; i < HostLog::kMost; ++i)
    log.add({begun + i, begun + i + 1 + i % 1000, HostKind::file, 0, "short", "", ""});
  log.add({begun, begun + HostLog::kMost + 2000, HostKind::host, 0, "around", "", ""});
  const std::vector<HostRecord> kept = log.since(begun);
  log.let_go();
  EXPECT_LE(kept.size(), HostLog::kMost / 2 + 1);
  EXPECT_GE(kept.size(), HostLog::kMost / 2 - 1000);
  EXPECT_EQ(kept.back().name, "around");
  for (const HostRecord& record : kept) EXPECT_GT(record.end - record.start, 500u);
  EXPECT_TRUE(log.since(0).empty()) << "let go";
}

TEST(Profiler, StagesHoldWhatTheHostDoesInThem) {
  auto ctx = open_context(Flavour::cpu);
  ctx->profiler().enable(true);
  {
    const Stage stage(*ctx, "encoder");
    sleep(20);
    const Stage inner(*ctx, "splat");
    compute(*ctx);
    ctx->finish();
  }
  const WallSplit split = split_wall(ctx->profiler().profile());
  const auto host_of = [&](const std::string& name) {
    for (const StageTotal& total : split.stages)
      if (total.stage == name) return static_cast<double>(total.parts[static_cast<std::size_t>(WallPart::host)]) * 1e-9;
    return 0.0;
  };
  EXPECT_GE(host_of("encoder"), 0.019);
  const auto has = [&](const std::string& name) {
    return std::any_of(split.stages.begin(), split.stages.end(), [&](const StageTotal& t) { return t.stage == name; });
  };
  EXPECT_TRUE(has("splat"));
  EXPECT_TRUE(has(""));
}

}  // namespace
}  // namespace vsplat
