#include "runtime/profile/energy.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace vsplat {
namespace {

namespace fs = std::filesystem;

// A folder like the kernel's powercap.
class EnergyTest : public ::testing::Test {
 protected:
  EnergyTest() {
    std::string name = (fs::temp_directory_path() / "vsplat-energy-XXXXXX").string();
    folder = ::mkdtemp(name.data());
  }
  ~EnergyTest() override { fs::remove_all(folder); }

  void put(const std::string& zone, const std::string& file, const std::string& text) {
    fs::create_directories(folder / zone);
    std::ofstream(folder / zone / file) << text << "\n";
  }
  void package(int number, const std::string& microjoules, const std::string& name = "package") {
    const std::string zone = "intel-rapl:" + std::to_string(number);
    put(zone, "name", name + "-" + std::to_string(number));
    put(zone, "max_energy_range_uj", "262143328850");
    put(zone, "energy_uj", microjoules);
  }

  fs::path folder;
};

TEST_F(EnergyTest, CountsEveryPackage) {
  package(0, "1000000");
  package(1, "5000000");
  package(2, "7", "psys");                // contains the packages
  put("intel-rapl:0:0", "name", "core");  // contained in a package
  put("intel-rapl:0:0", "energy_uj", "1");
  put("dtpm", "name", "package-9");
  EnergyMeter meter(rapl_sources(folder.string()));
  meter.start();
  package(0, "3500000");
  package(1, "5250000");
  meter.stop();
  const auto taken = meter.taken();
  ASSERT_EQ(taken.size(), 2u);
  EXPECT_EQ(taken[0].source, "package-0 (RAPL)");
  EXPECT_NEAR(taken[0].joules, 2.5, 1e-9);
  EXPECT_NEAR(taken[1].joules, 0.25, 1e-9);
}

TEST_F(EnergyTest, GoesOnWhereTheCounterBeginsAnew) {
  package(0, "262143000000");
  EnergyMeter meter(rapl_sources(folder.string()));
  meter.start();
  package(0, "671150");  // 328,850 to the range's end, plus this
  meter.stop();
  ASSERT_EQ(meter.taken().size(), 1u);
  EXPECT_NEAR(meter.taken()[0].joules, 1.0, 1e-6);
}

TEST_F(EnergyTest, WhatLiesBetweenTwoTimesDoesNotCount) {
  package(0, "0");
  EnergyMeter meter(rapl_sources(folder.string()));
  meter.start();
  package(0, "1000000");
  meter.stop();
  package(0, "9000000");
  meter.start();
  package(0, "9500000");
  meter.sample();  // too soon to read
  meter.stop();
  EXPECT_NEAR(meter.taken().at(0).joules, 1.5, 1e-9);
}

TEST_F(EnergyTest, IsAbsentWhereItCannotBeRead) {
  EXPECT_TRUE(rapl_sources((folder / "nothing").string()).empty());
  package(0, "damaged");
  EXPECT_TRUE(rapl_sources(folder.string()).empty());
  package(0, "17");
  EnergyMeter meter(rapl_sources(folder.string()));
  meter.start();
  fs::remove(folder / "intel-rapl:0" / "energy_uj");
  meter.stop();
  EXPECT_TRUE(meter.taken().empty());
  EXPECT_TRUE(nvml_sources("").empty());
  EXPECT_TRUE(nvml_sources("0000ffff:ff:1f.0").empty());
}

}  // namespace
}  // namespace vsplat
