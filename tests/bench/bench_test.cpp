#include "bench/bench.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/device.h"

namespace vsplat {
namespace {

TEST(Bench, ReportsEachCaseAgainstPeaksOfTheSameRun) {
  bench::Options options;
  options.suites = {"gemm", "conv"};
  options.filter = "small.16";
  options.seconds = 0;
  std::vector<std::string> seen;
  options.on_case = [&](const std::string& name) { seen.push_back(name); };
  const bench::Report report = bench::run(test::context(Flavour::cpu), options);
  ASSERT_EQ(report.results.size(), 1u);
  EXPECT_EQ(seen, std::vector<std::string>{"conv/small.16.128-128"});
  const bench::Result& r = report.results[0];
  EXPECT_GT(report.peak_gflops, 0);
  EXPECT_GT(report.peak_gbs, 0);
  EXPECT_GT(r.median_s, 0);
  EXPECT_NEAR(r.gflops * r.median_s * 1e9, 2.0 * 27 * 4096 * 128 * 128, 1e3);
  EXPECT_NEAR(r.share_of_peak, r.performed_gflops / report.peak_gflops, 1e-12);
  const auto json = nlohmann::json::parse(bench::json(report));
  EXPECT_EQ(json["results"][0]["name"], "small.16.128-128");
  EXPECT_EQ(json["results"][0]["kind"], "compute");
  EXPECT_NE(bench::table(report).find("conv/small.16.128-128"), std::string::npos);
}

TEST(Bench, UnknownSuiteIsAnErrorThatListsThem) {
  bench::Options options;
  options.suites = {"gem"};
  try {
    bench::run(test::context(Flavour::cpu), options);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(e.status(), Status::usage);
    EXPECT_NE(std::string(e.what()).find("gemm"), std::string::npos) << e.what();
  }
}

}  // namespace
}  // namespace vsplat
