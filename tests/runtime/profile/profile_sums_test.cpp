#include "runtime/profile/profile_sums.h"

#include <gtest/gtest.h>

#include "runtime/profile/profile_text.h"

namespace vsplat {
namespace {

ProfileRow row(const std::string& name, const std::string& stage, std::uint64_t total_ns = 0) {
  ProfileRow out;
  out.name = name, out.stage = stage, out.calls = 1, out.total_ns = total_ns;
  out.variants.resize(1);
  return out;
}

ProfileLaunch launch(std::size_t of, std::uint64_t start, std::uint64_t end) {
  ProfileLaunch out;
  out.row = of, out.start = start, out.end = end;
  out.queued = out.submitted = out.ready = start;
  return out;
}

HostRecord span(HostKind kind, const std::string& name, std::uint64_t start, std::uint64_t end,
                const std::string& stage = "") {
  return {start, end, kind, 0, name, "", stage};
}

std::uint64_t at(const WallParts& parts, WallPart part) { return parts[static_cast<std::size_t>(part)]; }

const StageTotal& stage_of(const WallSplit& split, const std::string& name) {
  for (const StageTotal& total : split.stages)
    if (total.stage == name) return total;
  throw std::runtime_error("no stage " + name);
}

const HostRow& host_row(const WallSplit& split, const std::string& name) {
  for (const HostRow& total : split.host)
    if (total.name == name) return total;
  throw std::runtime_error("no row " + name);
}

// [100, 1100) ns, times `unit`: a call from 150 to 900 that contains reading a file, an upload that overlaps a kernel,
// and a compilation.
Profile example(std::uint64_t unit = 1) {
  Profile out;
  out.windows = {{100, 1100}};
  out.rows = {row("gemm", "encoder", 200), row("write", "transfer", 40)};
  out.launches = {launch(0, 400, 600), launch(1, 600, 640)};
  out.host = {span(HostKind::host, "reconstruct", 150, 900), span(HostKind::file, "read", 200, 300),
              span(HostKind::upload, "write", 570, 660, "encoder"), span(HostKind::compile, "programs", 350, 450),
              span(HostKind::wait, "finishing", 800, 850)};
  for (ProfileWindow& w : out.windows) w.start *= unit, w.end *= unit;
  for (HostRecord& r : out.host) r.start *= unit, r.end *= unit;
  for (ProfileLaunch& l : out.launches)
    for (std::uint64_t* at : {&l.queued, &l.submitted, &l.ready, &l.start, &l.end}) *at *= unit;
  for (ProfileRow& r : out.rows) r.total_ns *= unit;
  return out;
}

TEST(ProfileSums, EveryInstantGoesToOnePart) {
  const WallSplit split = split_wall(example());
  EXPECT_EQ(wall_ns(example()), 1000u);
  EXPECT_EQ(at(split.parts, WallPart::device), 200u);               // 400 to 600
  EXPECT_EQ(at(split.parts, WallPart::upload), 60u);                // 600 to 660: before, the device was busy
  EXPECT_EQ(at(split.parts, WallPart::compile), 50u);               // 350 to 400
  EXPECT_EQ(at(split.parts, WallPart::file), 100u);                 // 200 to 300
  EXPECT_EQ(at(split.parts, WallPart::wait), 50u);                  // 800 to 850
  EXPECT_EQ(at(split.parts, WallPart::host), 50u + 50 + 140 + 50);  // the rest of 150 to 900
  EXPECT_EQ(at(split.parts, WallPart::other), 50u + 200);           // before and after the call
  EXPECT_EQ(sum_of(split.parts), 1000u);
}

TEST(ProfileSums, StagesAddUpToTheWallAndToTheirLaunches) {
  const WallSplit split = split_wall(example());
  std::uint64_t wall = 0, launches = 0;
  for (const StageTotal& total : split.stages) {
    wall += sum_of(total.parts);
    launches += total.launches_ns;
  }
  EXPECT_EQ(wall, 1000u);
  EXPECT_EQ(launches, launches_ns(example()));
  EXPECT_EQ(at(stage_of(split, "encoder").parts, WallPart::device), 200u);
  EXPECT_EQ(at(stage_of(split, "transfer").parts, WallPart::upload), 40u);  // the device's own time, 600 to 640
  EXPECT_EQ(at(stage_of(split, "encoder").parts, WallPart::upload), 20u);   // the additional time of the host
  EXPECT_EQ(split.stages.front().stage, "");
}

TEST(ProfileSums, RowsOfTheHostHaveTheirOwnTimeAndAll) {
  const WallSplit split = split_wall(example());
  EXPECT_EQ(host_row(split, "reconstruct").total_ns, 750u);
  EXPECT_EQ(host_row(split, "reconstruct").self_ns, 290u);
  EXPECT_EQ(host_row(split, "programs").total_ns, 100u);
  EXPECT_EQ(host_row(split, "programs").self_ns, 50u);
  EXPECT_EQ(host_row(split, "read").calls, 1u);
  EXPECT_EQ(split.host.front().name, "reconstruct");
}

// Time in nested spans counts for the inner one, whichever was reported first.
TEST(ProfileSums, InnerSpansTakeTheirTime) {
  for (const bool inner_first : {true, false}) {
    Profile p;
    p.windows = {{0, 100}};
    p.host = {span(HostKind::host, "outer", 10, 90), span(HostKind::host, "inner", 30, 50)};
    if (inner_first) std::swap(p.host[0], p.host[1]);
    const WallSplit split = split_wall(p);
    EXPECT_EQ(host_row(split, "outer").self_ns, 60u);
    EXPECT_EQ(host_row(split, "inner").self_ns, 20u);
    EXPECT_EQ(at(split.parts, WallPart::other), 20u);
  }
}

TEST(ProfileSums, OnlyWhatLiesInTheWindowsCounts) {
  Profile p;
  p.windows = {{100, 200}, {300, 400}};
  p.rows = {row("gemm", "encoder", 200)};
  p.launches = {launch(0, 50, 120), launch(0, 190, 310), launch(0, 390, 450)};
  p.host = {span(HostKind::host, "call", 0, 500), span(HostKind::host, "before", 10, 90)};
  const WallSplit split = split_wall(p);
  EXPECT_EQ(wall_ns(p), 200u);
  EXPECT_EQ(at(split.parts, WallPart::device), 20u + 10 + 10 + 10);
  EXPECT_EQ(sum_of(split.parts), 200u);
  EXPECT_EQ(host_row(split, "call").total_ns, 200u);
  EXPECT_EQ(host_row(split, "before").calls, 0u);
}

// Between the turn of a new variant and its start the driver compiles it; for a known variant this is the host's time.
TEST(ProfileSums, WhatTheDriverTakesForFirstLaunchesIsCompiling) {
  Profile p;
  p.windows = {{0, 1000}};
  p.rows = {row("gemm", "encoder", 20)};
  p.launches = {launch(0, 500, 510), launch(0, 800, 810)};
  p.launches[0].prepared = true, p.launches[0].ready = 100;
  p.launches[1].ready = 600;
  p.host = {span(HostKind::wait, "finishing", 0, 1000)};
  const WallSplit split = split_wall(p);
  EXPECT_EQ(at(split.parts, WallPart::compile), 400u);
  EXPECT_EQ(at(stage_of(split, "encoder").parts, WallPart::compile), 400u);
  EXPECT_EQ(host_row(split, "first launches").total_ns, 400u);
  EXPECT_EQ(at(split.parts, WallPart::wait), 580u);
  EXPECT_EQ(at(split.parts, WallPart::device), 20u);
}

// The host's part of an upload may consist of waiting for the driver's compiler.
TEST(ProfileSums, CompilingGoesBeforeWhatWaitsForIt) {
  Profile p;
  p.windows = {{0, 1000}};
  p.rows = {row("gemm", "encoder", 10), row("write", "transfer", 100)};
  p.launches = {launch(0, 500, 510), launch(1, 510, 610)};
  p.launches[0].prepared = true, p.launches[0].ready = 100;
  p.host = {span(HostKind::upload, "write", 50, 620)};
  const WallSplit split = split_wall(p);
  EXPECT_EQ(at(split.parts, WallPart::compile), 400u);
  EXPECT_EQ(at(split.parts, WallPart::upload), 50u + 100 + 10);
  EXPECT_EQ(at(split.parts, WallPart::device), 10u);
}

TEST(ProfileSums, OfNothingNothing) {
  const WallSplit split = split_wall({});
  EXPECT_EQ(sum_of(split.parts), 0u);
  EXPECT_TRUE(split.stages.empty());
  Profile idle;
  idle.windows = {{5, 25}};
  EXPECT_EQ(at(split_wall(idle).parts, WallPart::other), 20u);
}

TEST(ProfileSums, RowsAreBoundByWhatTakesThemLongestAtThePeaks) {
  const Peaks peaks{100, 10, 2, ""};  // operations and bytes per nanosecond, microseconds
  ProfileRow r = row("gemm", "encoder", 100'000);
  r.flops = r.performed_flops = 5e6, r.bytes = 1e5;  // 50 us and 10 us
  Roofline roof = roofline_of(r, peaks);
  EXPECT_EQ(roof.bound, Bound::compute);
  EXPECT_DOUBLE_EQ(roof.share_of_peak, 0.5);
  r.bytes = 8e5;  // 80 us
  roof = roofline_of(r, peaks);
  EXPECT_EQ(roof.bound, Bound::memory);
  EXPECT_DOUBLE_EQ(roof.share_of_peak, 0.8);
  r.calls = 50;  // of 1.6 us each
  EXPECT_EQ(roofline_of(r, peaks).bound, Bound::latency);
  r.calls = 1, r.performed_flops = 1.25e6, r.bytes = 0;  // a method that saves three quarters: it could take 12.5 us
  EXPECT_DOUBLE_EQ(roofline_of(r, peaks).share_of_peak, 0.125);
  r.performed_flops = 0;
  EXPECT_EQ(roofline_of(r, peaks).bound, Bound::none);
  r.bytes = 1;
  EXPECT_EQ(roofline_of(r, {}).bound, Bound::none);
}

TEST(ProfileSums, ClocksMeetWithinWhatAllAllow) {
  EXPECT_EQ(clock_offset({}), 0);
  // The device's clock is ahead by 1000: queued at 1105, between 100 and 110 on the host, and at 1201, between 195 and
  // 220.
  EXPECT_EQ(clock_offset({{1105, 100, 110}, {1201, 195, 220}}), 1000);
  EXPECT_EQ(clock_offset({{105, 1100, 1110}}), -1000);
  // The clocks drift, so no offset fits both: the median of the samples' offsets.
  EXPECT_EQ(clock_offset({{1105, 100, 110}, {2105, 1000, 1010}, {3205, 2000, 2010}}), 1100);
}

TEST(ProfileText, HasAllThatIsRecorded) {
  const std::string json = profile_json(example(), {"a device", "1.0", 17, {{"model", "small"}}});
  for (const char* part : {"\"device\": \"a device\"", "\"model\": \"small\"", "\"wall_s\"", "\"other_s\"",
                           "\"stages\"", "\"host\"", "\"launches\"", "\"queued_ns\"", "\"peak_bytes\": 17"})
    EXPECT_NE(json.find(part), std::string::npos) << part << " in\n" << json;
  const std::string trace = profile_trace(example());
  for (const char* part : {"device: running", "\"file\"", "\"compile\"", "launches that wait", "thread_name"})
    EXPECT_NE(trace.find(part), std::string::npos) << part << " in\n" << trace;
  const std::string table = profile_table(example(1'000'000));
  for (const char* part : {"reconstruct", "gemm", "encoder", "wall"})
    EXPECT_NE(table.find(part), std::string::npos) << part << " in\n" << table;
}

}  // namespace
}  // namespace vsplat
