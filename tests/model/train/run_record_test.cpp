#include "model/train/run_record.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using nlohmann::json;
using test::contents_of;
using test::put_file;
using test::TemporaryFolder;

RunRecord::Part on(const std::string& device, std::uint64_t limit = 1000) {
  RunRecord::Part out;
  out.device = device;
  out.driver = "driver";
  out.kernels = "cpu";
  out.limit = limit;
  return out;
}

json run(const std::string& path, long first, long last, const RunRecord::Part& part, std::uint64_t peak = 100) {
  RunRecord record(path, first, part);
  record.reach(last, 5, peak, 0);
  record.write();
  return json::parse(contents_of(path))["parts"];
}

TEST(RunRecord, HoldsDataAndDevice) {
  const TemporaryFolder folder;
  const std::string path = folder / "record.json";
  RunRecord record(path, 0, on("a"));
  DataSet data;
  for (const char* name : {"cup", "vase"}) data.objects.push_back({name, DataLayout::folder, "x", "", "set"});
  data.objects.push_back({"shoe", DataLayout::folder, "x", "", "\xff"});  // no UTF-8
  record.set_data(data, "patterns");
  record.reach(10, 2.5, 123, 4);
  record.reach(20, 5, 124, 5);
  record.write();
  const json expected = {{"data", {{{"path", "set"}, {"objects", 2}}, {{"path", "\xef\xbf\xbd"}, {"objects", 1}}}},
                         {"textures", "patterns"},
                         {"bad", 5},
                         {"parts",
                          {{{"device", "a"},
                            {"driver", "driver"},
                            {"kernels", "cpu"},
                            {"tuning", ""},
                            {"switched_off", ""},
                            {"limit_bytes", 1000},
                            {"peak_bytes", 124},
                            {"first", 0},
                            {"last", 20},
                            {"starts", 1},
                            {"seconds", 5.0}}}}};
  EXPECT_EQ(json::parse(contents_of(path)), expected);
}

TEST(RunRecord, GoesOnWithTheDevicesBefore) {
  const TemporaryFolder folder;
  const std::string path = folder / "record.json";
  run(path, 0, 25, on("a"), 300);
  // Killed after step 25 and continued from 20: the same device forms a single stretch.
  json parts = run(path, 20, 40, on("a", 2000), 200);
  ASSERT_EQ(parts.size(), 1);
  EXPECT_EQ(parts[0]["first"], 0);
  EXPECT_EQ(parts[0]["last"], 40);
  EXPECT_EQ(parts[0]["starts"], 2);
  EXPECT_EQ(parts[0]["seconds"], 10);
  EXPECT_EQ(parts[0]["peak_bytes"], 300);
  EXPECT_EQ(parts[0]["limit_bytes"], 2000);
  parts = run(path, 30, 50, on("b"));
  ASSERT_EQ(parts.size(), 2);
  EXPECT_EQ(parts[0]["last"], 30);
  EXPECT_EQ(parts[1]["first"], 30);
  // Continued from a checkpoint before that device's steps, which are then dropped.
  parts = run(path, 30, 60, on("c"));
  ASSERT_EQ(parts.size(), 2);
  EXPECT_EQ(parts[1]["device"], "c");
  // Started again from the beginning.
  EXPECT_EQ(run(path, 0, 10, on("d")).size(), 1);
}

TEST(RunRecord, WhatCannotBeReadIsLeftOut) {
  const TemporaryFolder folder;
  const std::string path = folder / "record.json";
  for (const char* text : {"", "{", "[]", "{\"parts\": 3}", "{\"parts\": [3, {\"device\": 4}, {}]}"}) {
    put_file(path, text);
    const json parts = run(path, 10, 20, on("a"));
    ASSERT_EQ(parts.size(), 1) << text;
    EXPECT_EQ(parts[0]["first"], 10);
  }
}

}  // namespace
}  // namespace vsplat
