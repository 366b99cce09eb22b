// Findings on machines unlike this one: with GPUs, in containers. tests/cli/doctor_test.py tests the rest.
#include "model/diagnose/doctor.h"

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <optional>
#include <string>
#include <utility>

#include "model/diagnose/personal.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

// A system's files in a temporary folder.
class System {
 public:
  System() { fs::permissions(root_, fs::perms::all); }

  fs::path file(const std::string& path, const std::string& text = "") const {
    fs::create_directories((root_ / path).parent_path());
    std::ofstream(root_ / path) << text;
    return root_ / path;
  }
  void gpu(const std::string& slot, const std::string& vendor) const {
    file("sys/bus/pci/devices/" + slot + "/class", "0x030000\n");
    file("sys/bus/pci/devices/" + slot + "/vendor", vendor + "\n");
  }
  const fs::path& root() const { return root_; }

 private:
  test::TemporaryFolder folder_;
  fs::path root_ = folder_.path();
};

// A processor's device, its driver's entry, and nothing else.
Looked with_a_processor() {
  Looked out;
  out.loader = {"/usr/lib/libOpenCL.so.1", true};
  out.entries.place = "/etc/OpenCL/vendors";
  out.entries.folder = true;
  SeenDevice device;
  device.type = "cpu", device.name = "processor";
  LookedDriver driver;
  driver.entry = {"/etc/OpenCL/vendors/pocl.icd", "libpocl.so.2", ""};
  driver.seen.platforms = {{"Portable Computing Language", "OpenCL 3.0", {device}}};
  out.entries.entries = {driver.entry};
  out.drivers = {driver};
  out.all = driver.seen;
  out.devices = {{0, 0, 0, "Portable Computing Language", device}};
  return out;
}

const Finding* find(const std::vector<Finding>& all, const std::string& kind) {
  for (const Finding& finding : all)
    if (finding.kind == kind) return &finding;
  return nullptr;
}

TEST(Doctor, FindsNothingWrongWithAProcessorAlone) {
  EXPECT_TRUE(findings_of(with_a_processor()).empty());
  const System system;
  const GpuFiles files = gpu_files(system.root());
  EXPECT_FALSE(files.has_nvidia || files.has_amd || files.has_intel || files.container);
  EXPECT_TRUE(files.nvidia.empty() && files.amd.empty() && files.render.empty());
}

// The findings of a self-test for a present device with that driver.
TEST(Doctor, TellsWhatSelfTestsFound) {
  Looked looked = with_a_processor();
  looked.devices[0].seen.driver = "3.1";
  StoredVerdict kept{"processor", "3.1", {Fitness::ok, {}, "", "2026-11-23"}};
  looked.verdicts = {kept};
  EXPECT_TRUE(findings_of(looked).empty());
  kept.verdict = {Fitness::degraded, {}, std::string(100, 'x') + " kernel k is off by 0.5", "2026-11-23"};
  kept.verdict.off.winograd = true;
  looked.verdicts = {kept};
  std::vector<Finding> found = findings_of(looked);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, "device_degraded");
  for (const char* words : {"processor with driver 3.1", "Winograd's convolutions", "2026-11-23", "k is off by 0.5"})
    EXPECT_NE(found[0].found.find(words), std::string::npos) << found[0].found;
  looked.verdicts[0].verdict.fitness = Fitness::unusable;
  found = findings_of(looked);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, "device_unusable");
  for (const char* words : {"processor with driver 3.1", "2026-11-23", "k is off by 0.5"})
    EXPECT_NE(found[0].found.find(words), std::string::npos) << found[0].found;
  EXPECT_NE(found[0].mend.find("VSPLAT_SELFTEST=ignore"), std::string::npos);
  looked.verdicts[0].driver = "3.0";
  EXPECT_TRUE(findings_of(looked).empty());
}

TEST(Doctor, TellsAContainerThatWasNotGivenItsGpu) {
  const System system;
  system.file(".dockerenv");
  system.gpu("0000:01:00.0", "0x10de");
  Looked looked = with_a_processor();
  looked.files = gpu_files(system.root());
  EXPECT_TRUE(looked.files.has_nvidia && looked.files.container);
  const Finding* found = nullptr;
  const std::vector<Finding> nvidia = findings_of(looked);
  ASSERT_TRUE(found = find(nvidia, "no_gpu_files"));
  EXPECT_EQ(found->about, "/dev/nvidia0");
  EXPECT_NE(found->mend.find("`--gpus all`"), std::string::npos);

  const System others;
  others.gpu("0000:03:00.0", "0x1002");
  looked.files = gpu_files(others.root());
  const std::vector<Finding> amd = findings_of(looked);
  ASSERT_TRUE(found = find(amd, "no_gpu_files"));
  EXPECT_NE(found->mend.find("`--device /dev/kfd --device /dev/dri`"), std::string::npos);
  EXPECT_TRUE(find(amd, "no_gpu_driver"));

  const System intel;
  intel.gpu("0000:00:02.0", "0x8086");
  looked.files = gpu_files(intel.root());
  const std::vector<Finding> all = findings_of(looked);
  ASSERT_TRUE(found = find(all, "no_gpu_files"));
  EXPECT_EQ(found->about, "/dev/dri");
}

TEST(Doctor, TellsADriverPartThatTheContainerWasNotGiven) {
  const System system;
  system.file("dev/nvidia0");
  system.file("dev/nvidiactl");
  system.file("dev/nvidia-modeset");
  Looked looked = with_a_processor();
  looked.files = gpu_files(system.root());
  EXPECT_TRUE(looked.files.nvidia_gpu());
  EXPECT_EQ(looked.files.nvidia.size(), 2u);
  ASSERT_EQ(::setenv("NVIDIA_DRIVER_CAPABILITIES", "utility,graphics", 1), 0);
  const std::vector<Finding> found = findings_of(looked);
  ::unsetenv("NVIDIA_DRIVER_CAPABILITIES");
  ASSERT_TRUE(find(found, "no_gpu_driver"));
  EXPECT_NE(find(found, "no_gpu_driver")->mend.find("NVIDIA_DRIVER_CAPABILITIES=compute,utility"), std::string::npos);
  ASSERT_TRUE(find(found, "container_flags"));
  EXPECT_FALSE(find(findings_of(looked), "container_flags"));
}

TEST(Doctor, TellsAFileThatMayNotBeOpened) {
  const System system;
  const fs::path node = system.file("dev/dri/renderD128");
  fs::permissions(node, fs::perms::none);
  const bool root = ::geteuid() == 0;
  if (root) {
    ASSERT_EQ(::seteuid(65534), 0);  // root may open everything
  }
  const GpuFiles files = gpu_files(system.root());
  if (root) {
    ASSERT_EQ(::seteuid(0), 0);
  }
  ASSERT_EQ(files.render.size(), 1u);
  EXPECT_EQ(files.render[0].problem, "Permission denied");
  Looked looked = with_a_processor();
  looked.files = files;
  for (const auto& [group, joined] : {std::pair{"video", "video"}, {"root", "render"}, {"", "render"}}) {
    looked.files.render[0].group = group;
    const std::vector<Finding> found = findings_of(looked);
    ASSERT_TRUE(find(found, "device_file"));
    EXPECT_EQ(find(found, "device_file")->about, node.string());
    EXPECT_NE(find(found, "device_file")->mend.find(fmt::format("`sudo usermod -aG {} $USER`", joined)),
              std::string::npos);
  }
  // If one GPU can be used, no other is needed.
  looked.devices[0].seen.type = "gpu";
  EXPECT_FALSE(find(findings_of(looked), "device_file"));
}

TEST(Doctor, TellsAnInstalledDriverWithoutAnEntry) {
  Looked looked = with_a_processor();
  looked.installed = {{"NVIDIA", "/usr/local/nvidia/lib64/libnvidia-opencl.so.1", "nvidia.icd", true, false},
                      {"PoCL", "/usr/lib/libpocl.so.2", "pocl.icd", false, true}};
  const std::vector<Finding> found = findings_of(looked);
  const Finding* entry = find(found, "library_without_entry");
  ASSERT_TRUE(entry);
  for (const char* words : {"`mkdir -p /etc/OpenCL/vendors && echo /usr/local/nvidia/lib64/libnvidia-opencl.so.1 > "
                            "/etc/OpenCL/vendors/nvidia.icd`",
                            "set OCL_ICD_VENDORS to that folder", "add /usr/local/nvidia/lib64 to LD_LIBRARY_PATH"})
    EXPECT_NE(entry->mend.find(words), std::string::npos) << entry->mend;
}

TEST(Doctor, TellsAGpuDriverThatGivesNoDevice) {
  Looked looked = with_a_processor();
  looked.installed = {{"Intel", "/usr/lib/intel-opencl/libigdrcl.so", "intel.icd", true, true}};
  LookedDriver driver;
  driver.entry = {"/etc/OpenCL/vendors/intel.icd", "/usr/lib/intel-opencl/libigdrcl.so", ""};
  looked.drivers.push_back(driver);
  EXPECT_TRUE(find(findings_of(looked), "no_devices"));
  EXPECT_FALSE(find(findings_of(looked), "library_without_entry"));
}

TEST(DriverEntries, AreThoseThatTheLoaderFinds) {
  const System system;
  const std::string folder = system.file("vendors/b.icd", "libb.so.1\nlibc.so\n").parent_path().string();
  system.file("vendors/a.icd", "/opt/a.so \n");
  system.file("vendors/c.icd.off", "libc.so\n");
  const test::Variable vendors("OCL_ICD_VENDORS", folder), files("OCL_ICD_FILENAMES", "/x.so:y.so"),
      path("OPENCL_VENDOR_PATH", "");
  const DriverEntries ocl_icd = driver_entries(true);
  EXPECT_EQ(ocl_icd.variable, "OCL_ICD_VENDORS");
  EXPECT_TRUE(ocl_icd.folder && ocl_icd.problem.empty());
  ASSERT_EQ(ocl_icd.entries.size(), 2u);
  EXPECT_EQ(ocl_icd.entries[0].library, "/opt/a.so ");
  EXPECT_EQ(ocl_icd.entries[1].library, "libb.so.1");
  const DriverEntries khronos = driver_entries(false);
  ASSERT_EQ(khronos.entries.size(), 4u);
  EXPECT_EQ(khronos.entries[2].library, "/x.so");
  EXPECT_EQ(khronos.entries[3].file, "");
}

TEST(DriverEntries, MayBeOneFileOrOneLibraryForOclIcd) {
  const System system;
  const fs::path entry = system.file("vendors/a.icd", "liba.so\n");
  const test::Variable path("OPENCL_VENDOR_PATH", entry.parent_path().string()), files("OCL_ICD_FILENAMES", "");
  for (const std::string& name : {entry.string(), std::string("a.icd")}) {
    const test::Variable vendors("OCL_ICD_VENDORS", name);
    const DriverEntries found = driver_entries(true);
    ASSERT_EQ(found.entries.size(), 1u) << name;
    EXPECT_EQ(found.entries[0].file, entry.string());
    EXPECT_EQ(found.entries[0].library, "liba.so");
  }
  {
    const test::Variable vendors("OCL_ICD_VENDORS", "libother.so.3");
    const DriverEntries found = driver_entries(true);
    ASSERT_EQ(found.entries.size(), 1u);
    EXPECT_EQ(found.entries[0].library, "libother.so.3");
    EXPECT_EQ(driver_entries(false).problem, "is not there");
  }
  const test::Variable none("OCL_ICD_VENDORS", "");
  EXPECT_EQ(driver_entries(true).variable, "OPENCL_VENDOR_PATH");
  EXPECT_EQ(driver_entries(true).entries.size(), 1u);
  EXPECT_EQ(driver_entries(false).place, "/etc/OpenCL/vendors");
}

TEST(Personal, IsReplacedWhereItStandsAlone) {
  const Personal who = {{"/data/people/ann"}, {"ann"}, {"box.example.org", "box"}};
  EXPECT_EQ(without_personal("/data/people/ann/x and /data/people/anna/x", who), "~/x and /data/people/anna/x");
  EXPECT_EQ(without_personal("HOME=/data/people/ann", who), "HOME=~");
  EXPECT_EQ(without_personal("ann@box.example.org, ann_1, planned, box-2", who), "USER@HOST, USER_1, planned, HOST-2");
  EXPECT_EQ(without_personal("/home/bob/x:/home/eve, /Users/kim", who), "/home/USER/x:/home/USER, /Users/USER");
  EXPECT_EQ(without_personal("/home/", who), "/home/");
  EXPECT_EQ(without_personal("", who), "");
}

}  // namespace
}  // namespace vsplat
