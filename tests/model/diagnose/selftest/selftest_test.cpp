// The self-test covers every kernel, blames the right ones, and finds nothing on a sound device.
#include "model/diagnose/selftest/selftest.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/stages.h"
#include "tests/support/device.h"
#include "tests/support/golden.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

using selftest::by_kernel;
using selftest::Finding;
using selftest::KernelVerdict;

std::string device_index() { return std::to_string(test::context(Flavour::cpu).device().index); }

// A quick run, shared by the tests that examine it.
const selftest::Report& quick_report() {
  static const selftest::Report report = [] {
    selftest::Options options;
    options.quick = true;
    return selftest::run(device_index(), options);
  }();
  return report;
}

// Fails for a new kernel that no case launches: it needs a case in model/diagnose/selftest/cases/.
TEST(Selftest, LaunchesEveryKernelOfBothFlavours) {
  ASSERT_EQ(quick_report().flavours.size(), 2u);
  for (const selftest::FlavourResult& flavour : quick_report().flavours) {
    EXPECT_GT(flavour.kernels.size(), 100u);
    for (const NamedKernel& kernel : flavour.untested)
      ADD_FAILURE() << name_of(flavour.flavour) << ": no case launches " << kernel.name << " of cl/" << kernel.file
                    << ".cl";
  }
}

TEST(Selftest, FindsNothingOnASoundDevice) {
  EXPECT_EQ(quick_report().verdict.fitness, Fitness::ok) << quick_report().verdict.worst;
  for (const selftest::FlavourResult& flavour : quick_report().flavours) {
    EXPECT_GT(flavour.results, 500);
    for (const Finding& f : flavour.wrong)
      ADD_FAILURE() << name_of(flavour.flavour) << ": " << f.what << ": " << f.error << " (" << f.tolerance << ") "
                    << f.trouble;
    for (const selftest::KernelResult& k : flavour.kernels) EXPECT_EQ(k.verdict, KernelVerdict::right) << k.kernel.name;
  }
}

Finding finding(const std::vector<std::string>& kernels, bool right, double error = 0.5) {
  Finding f;
  f.what = "a result";
  for (const std::string& k : kernels) f.kernels.push_back({"file", k, ""});
  f.right = right, f.error = error, f.tolerance = 1e-5;
  return f;
}

std::map<std::string, KernelVerdict> verdicts(const std::vector<Finding>& findings) {
  std::map<std::string, KernelVerdict> out;
  for (const auto& k : by_kernel(findings)) out[k.kernel.name] = k.verdict;
  return out;
}

TEST(SelftestBlame, FallsOnTheKernelOfASmallResult) {
  const auto v =
      verdicts({finding({"gemm", "pack"}, false), finding({"pack"}, true), finding({"gemm", "rows", "tokens"}, false)});
  EXPECT_EQ(v.at("gemm"), KernelVerdict::wrong);
  EXPECT_EQ(v.at("pack"), KernelVerdict::right);
  EXPECT_EQ(v.at("rows"), KernelVerdict::in_doubt) << "no right result, but the product explains it";
}

TEST(SelftestBlame, FallsOnAllWhereNothingTellsWhich) {
  const auto v = verdicts({finding({"a", "b"}, false), finding({"a", "b"}, true), finding({"c"}, true)});
  EXPECT_EQ(v.at("a"), KernelVerdict::wrong);
  EXPECT_EQ(v.at("b"), KernelVerdict::wrong);
  EXPECT_EQ(v.at("c"), KernelVerdict::right);
}

TEST(SelftestBlame, TellsTheWorstResult) {
  const auto k = by_kernel({finding({"a"}, true, 1e-6), finding({"a"}, false, INFINITY), finding({"a"}, false, 0.1)});
  ASSERT_EQ(k.size(), 1u);
  EXPECT_EQ(k[0].results, 3);
  EXPECT_EQ(k[0].wrong, 2);
  EXPECT_TRUE(std::isinf(k[0].error));
}

class SelftestChecks : public test::FlavourTest {};
VSPLAT_FLAVOURS(SelftestChecks);

// NaN, another size and different bits in the second run are wrong, and so is a thrown error.
TEST_P(SelftestChecks, FindWhatIsWrong) {
  const auto one = [&](const std::function<void(selftest::Checks&)>& work) {
    const auto own = test::open_context(GetParam());
    selftest::Checks c(*own, selftest::Sizes::quick);
    c.run("case", work);
    EXPECT_EQ(c.findings().size(), 1u);
    return c.findings().at(0);
  };
  const std::vector<double> want = {1, 2};
  EXPECT_TRUE(one([&](auto& c) { c.close("x", std::vector<float>{1, 2}, want, 1e-6); }).right);
  EXPECT_FALSE(one([&](auto& c) { c.close("x", std::vector<float>{1, 2.1f}, want, 1e-2); }).right);
  EXPECT_FALSE(one([&](auto& c) { c.close("x", std::vector<float>{1, NAN}, want, 1e-2); }).right);
  EXPECT_FALSE(one([&](auto& c) { c.close("x", std::vector<float>{1}, want, 1e-2); }).right);
  EXPECT_FALSE(one([&](auto& c) { c.equal("x", std::vector<int>{1, 2}, std::vector<int>{1, 3}); }).right);
  float next = 1;
  const Finding other = one([&](auto& c) { c.close("x", std::vector<float>{next += 1e-7f, 2}, want, 1e-2); });
  EXPECT_FALSE(other.right);
  EXPECT_EQ(other.trouble, "other bits the second time");
  const Finding thrown = one([&](auto&) { throw Error(Status::device, "it broke"); });
  EXPECT_FALSE(thrown.right);
  EXPECT_EQ(thrown.trouble, "it broke");
}

// Temporary conditions, such as a lack of memory or disk space, are no fault of the device: they end the self-test.
TEST(SelftestErrors, ThatTellNothingOfTheDeviceEndIt) {
  const auto own = test::open_context(Flavour::cpu);
  selftest::Checks c(*own, selftest::Sizes::quick);
  for (const Status status : {Status::memory, Status::file, Status::usage, Status::busy, Status::cancelled}) {
    test::expect_error(status, {"case", "no room"},
                       [&] { c.run("case", [&](auto&) { throw Error(status, "no room"); }); });
  }
  EXPECT_TRUE(c.findings().empty());
}

bool without_winograd(selftest::Checks& c) { return c.ctx.switched_off().winograd; }
bool in(selftest::Checks& c, Flavour flavour) { return c.ctx.flavour() == flavour; }

selftest::Report report_of(const std::vector<selftest::Case>& cases) {
  selftest::Options options;
  options.cases = cases;
  options.forget = true;
  return selftest::run(device_index(), options);
}

// The replacement of a wrong kernel is tested before it is used, in both flavours.
TEST(SelftestErrors, WhatIsLeftOnIsRightToo) {
  const selftest::Case wrong_of_gpu = {
      "wrong", [](selftest::Checks& c) { c.that("w", in(c, Flavour::cpu) || without_winograd(c)); }};
  selftest::Report report = report_of({wrong_of_gpu});
  EXPECT_EQ(report.verdict.fitness, Fitness::degraded);
  EXPECT_EQ(in_words(report.verdict.off), "Winograd's convolutions");
  // Now the direct sum is wrong on the cpu kernels, which were right with Winograd's method.
  report = report_of(
      {wrong_of_gpu, {"other", [](selftest::Checks& c) { c.that("o", in(c, Flavour::gpu) || !without_winograd(c)); }}});
  EXPECT_EQ(in_words(report.verdict.off), "cpu kernels, Winograd's convolutions");
  EXPECT_EQ(report.flavours[0].wrong.size(), 1u);
  // Wrong on the same kernels: then none of them is left.
  report = report_of(
      {wrong_of_gpu, {"other", [](selftest::Checks& c) { c.that("o", in(c, Flavour::cpu) || !without_winograd(c)); }}});
  EXPECT_EQ(in_words(report.verdict.off), "gpu kernels");
  EXPECT_EQ(report.verdict.fitness, Fitness::degraded);
}

// Runs self-tests of these cases only, with a table named by the environment.
TEST(SelftestErrors, ATableIsTriedWithItsOwnFlavour) {
  const test::TemporaryFolder folder;
  for (const Flavour flavour : {Flavour::cpu, Flavour::gpu}) {
    TuningTable table;
    table.of = tuning_subject(test::context(flavour).device(), flavour);
    const TunedShape shape{TunedOp::gemm, {64, 33, 40, 1}};
    table.choice.set(shape, all_values(*tuned_declaration(TunedOp::gemm, flavour)).back());
    write_tuning(folder / "table.json", table);
    const test::Variable named("VSPLAT_TUNING", folder.path("table.json").c_str());
    selftest::Options options;
    options.cases = {{"nothing", [](selftest::Checks&) {}}};
    const selftest::Report report = selftest::run(device_index(), options);
    ASSERT_EQ(report.flavours.size(), 2u);
    for (const selftest::FlavourResult& one : report.flavours)
      EXPECT_EQ(one.chosen.size(), one.flavour == flavour ? 1u : 0u) << name_of(one.flavour);
  }
}

// The library's embedded results of the network's stages are PyTorch's.
TEST(SelftestStages, AreThoseOfTheGoldenVectors) {
  const SafetensorsFile file("stages", selftest::stages_file());
  const test::Golden golden = test::Golden::load("micro");
  EXPECT_EQ(file.metadata(), golden.file().metadata());
  EXPECT_GT(file.tensors().size(), 100u);
  for (const TensorEntry& entry : file.tensors()) {
    if (entry.dtype != Dtype::f32) continue;
    EXPECT_EQ(file.floats(entry), golden.floats(entry.name)) << entry.name;
  }
}

}  // namespace
}  // namespace vsplat
