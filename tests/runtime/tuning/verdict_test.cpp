#include "runtime/tuning/verdict.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>

#include "runtime/context.h"
#include "runtime/error.h"
#include "runtime/files/disk_cache.h"
#include "runtime/log.h"
#include "runtime/tuning/stored_verdicts.h"
#include "runtime/tuning/tuning.h"
#include "tests/support/device.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

class VerdictTest : public ::testing::Test {
 protected:
  VerdictTest() { device_.name = "a device", device_.driver = "1.0"; }
  // The warnings during the call.
  static std::string warned(const std::function<void()>& call) {
    const test::Warnings warnings;
    call();
    return warnings.text();
  }
  fs::path file() const {
    for (const auto& entry : fs::directory_iterator(home_ / "deep/cache/verdicts")) return entry.path();
    return {};
  }

  const test::TemporaryFolder home_;
  const test::Variable cache_{"VSPLAT_CACHE_DIR", home_ / "deep/cache"}, kernels_{"VSPLAT_KERNEL_DIR", nullptr},
      ignore_{"VSPLAT_SELFTEST", nullptr};
  DeviceInfo device_;
};

TEST_F(VerdictTest, IsRememberedForTheDeviceAndItsDriver) {
  EXPECT_FALSE(remembered_verdict(device_));
  EXPECT_FALSE(fit_for_use(device_).any());
  Verdict verdict{Fitness::degraded, {}, "kernel k is off", "2026-11-23"};
  verdict.off.winograd = verdict.off.clblast = true;
  ASSERT_TRUE(remember(device_, verdict));
  const auto got = remembered_verdict(device_);
  ASSERT_TRUE(got);
  EXPECT_EQ(got->fitness, Fitness::degraded);
  EXPECT_TRUE(got->off == verdict.off);
  EXPECT_EQ(got->worst, verdict.worst);
  EXPECT_EQ(got->date, verdict.date);
  EXPECT_TRUE(fit_for_use(device_) == verdict.off);
  EXPECT_EQ(in_words(verdict.off), "Winograd's convolutions, CLBlast");
  DeviceInfo other = device_;
  ASSERT_EQ(stored_verdicts().size(), 1u);
  EXPECT_EQ(stored_verdicts()[0].device, "a device");
  EXPECT_EQ(stored_verdicts()[0].driver, "1.0");
  EXPECT_TRUE(stored_verdicts()[0].verdict.off == verdict.off);
  ::setenv("VSPLAT_LIMITS", "memory=1G", 1);
  EXPECT_TRUE(stored_verdicts().empty()) << "of the device as it is";
  ::unsetenv("VSPLAT_LIMITS");
  other.driver = "1.1";
  EXPECT_FALSE(remembered_verdict(other)) << "of another driver nothing is known";
  ASSERT_TRUE(remember(device_, {}));
  EXPECT_FALSE(fit_for_use(device_).any()) << "the last one counts";
}

TEST_F(VerdictTest, AnUnusableDeviceIsRefusedButWhereItIsIgnored) {
  Verdict verdict{Fitness::unusable, {}, "kernel k is off by 0.5", "2026-11-23"};
  verdict.off.cpu = verdict.off.gpu = true;
  ASSERT_TRUE(remember(device_, verdict));
  test::expect_error(Status::device,
                     {"a device", "driver 1.0", "kernel k is off by 0.5", "2026-11-23", "VSPLAT_SELFTEST=ignore"},
                     [&] { fit_for_use(device_); });
  ::setenv("VSPLAT_SELFTEST", "ignore", 1);
  EXPECT_FALSE(fit_for_use(device_).any());
}

// If new files are writable by the group, as with the umask of many systems, the cache still belongs to its owner.
TEST_F(VerdictTest, IsBelievedWhateverTheUmask) {
  const mode_t before = ::umask(002);
  const bool remembered = remember(device_, {Fitness::degraded, {}, "k", "2026-11-23"});
  const DiskCache cache;
  cache.store("a", {1, 2, 3});
  TuningTable table;
  table.of = tuning_subject(device_, Flavour::cpu);
  table.choice.set({TunedOp::gemm, {64, 8, 8, 1}}, all_values(*tuned_declaration(TunedOp::gemm, Flavour::cpu)).back());
  write_tuning(tuning_path(table.of), table);
  ::umask(before);
  ASSERT_TRUE(remembered);
  EXPECT_TRUE(remembered_verdict(device_));
  EXPECT_TRUE(cache.load("a"));
  const test::Variable tuning("VSPLAT_TUNING", nullptr);
  EXPECT_EQ(tuning_for(device_, Flavour::cpu)->hash(), table.choice.hash());
}

// A self-test decides itself what is switched off, and finds the same errors again.
TEST_F(VerdictTest, WhoTestsADeviceOpensItAllTheSame) {
  const DeviceInfo device = test::context(Flavour::cpu).device();
  ContextOptions options;
  options.device = std::to_string(device.index);
  ASSERT_TRUE(remember(device, {Fitness::unusable, {}, "kernel k is off", "2026-11-23"}));
  EXPECT_THROW(Context refused(options), Error);
  options.off = SwitchedOff{};
  EXPECT_NO_THROW(Context opened(options));
}

TEST_F(VerdictTest, DamagedOnesAndThoseOfOthersSayNothing) {
  ASSERT_TRUE(remember(device_, {Fitness::degraded, {}, "k", "2026-11-23"}));
  ASSERT_EQ(::chmod(file().c_str(), 0666), 0);
  const std::string said = warned([&] { EXPECT_FALSE(remembered_verdict(device_)) << "others may write to it"; });
  for (const std::string& words : {device_.name, file().string(), std::string("chmod go-w")})
    EXPECT_NE(said.find(words), std::string::npos) << said;
  for (const char* text : {"", "{", "[]", "null", "{\"verdict\": 3}", "{\"verdict\": \"ok\", \"off\": 1}"}) {
    ASSERT_TRUE(remember(device_, {Fitness::degraded, {}, "k", "2026-11-23"}));
    std::ofstream(file()) << text;
    EXPECT_FALSE(remembered_verdict(device_)) << text;
  }
  ::setenv("VSPLAT_CACHE_DIR", "off", 1);
  EXPECT_NE(warned([&] { EXPECT_FALSE(remember(device_, {})); }).find("VSPLAT_CACHE_DIR is off"), std::string::npos);
  EXPECT_FALSE(remembered_verdict(device_));
  // If the folder cannot be created, the error names it and the reason.
  std::ofstream(home_ / "file") << "x";
  ::setenv("VSPLAT_CACHE_DIR", (home_ / "file/cache").c_str(), 1);
  const std::string why = warned([&] { EXPECT_FALSE(remember(device_, {})); });
  for (const std::string& words :
       {home_ / "file/cache", std::string("Not a directory"), std::string("VSPLAT_CACHE_DIR")})
    EXPECT_NE(why.find(words), std::string::npos) << why;
}

// Kernels from a folder have a verdict of their own, which is not stored in the user's default cache.
TEST_F(VerdictTest, IsOfTheKernelsText) {
  ASSERT_TRUE(remember(device_, {Fitness::degraded, {}, "k", "2026-11-23"}));
  const std::string embedded = kernels_hash();
  const fs::path folder = home_ / "cl";
  fs::create_directories(folder);
  std::ofstream(folder / "a.cl") << "kernel void a() {}\n";
  ::setenv("VSPLAT_KERNEL_DIR", folder.c_str(), 1);
  const std::string one = kernels_hash();
  EXPECT_NE(one, embedded);
  EXPECT_FALSE(remembered_verdict(device_));
  ASSERT_TRUE(remember(device_, {Fitness::degraded, {}, "k", "2026-11-23"}));
  EXPECT_TRUE(remembered_verdict(device_));
  std::ofstream(folder / "a.cl") << "kernel void b() {}\n";
  EXPECT_NE(kernels_hash(), one);
  EXPECT_FALSE(remembered_verdict(device_));
  ::unsetenv("VSPLAT_CACHE_DIR");
  EXPECT_FALSE(remember(device_, {}));
}

}  // namespace
}  // namespace vsplat
