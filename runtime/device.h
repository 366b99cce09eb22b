// Which OpenCL devices there are, what they can do, and how a user names one.
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "runtime/precision.h"

namespace vsplat {

enum class DeviceType : int { cpu = 1, gpu = 2, accelerator = 3, other = 4 };
const char* name_of(DeviceType type);

// Where a device is on the bus.
struct PciAddress {
  std::uint32_t domain = 0, bus = 0, device = 0, function = 0;
};

struct DeviceInfo {
  int index = 0;     // flat, over all platforms
  int platform = 0;  // position of the platform
  int device = 0;    // position within the platform
  std::string name, vendor, driver, version, platform_name, platform_version;
  DeviceType type = DeviceType::other;
  std::uint64_t memory = 0;        // bytes
  std::uint64_t max_alloc = 0;     // bytes of the largest single buffer
  std::uint64_t local_memory = 0;  // bytes per work-group
  bool local_is_fast = false;      // local memory of its own, not a piece of global memory
  std::size_t max_work_group = 1;  // in the first direction; kernels have groups in no other
  int compute_units = 1;
  int native_float_width = 1;    // less than 4: its compiler takes vectors apart
  int align = 128;               // bytes: where a sub-buffer may start
  int address_bits = 64;         // of the device's sizes
  bool event_profiling = false;  // device events carry times
  bool fp16 = false, fp64 = false, subgroups = false;
  // Of a GPU whose compiler can be told how many work-items run as one: the least number that fills its vectors; 0 of a
  // device that is left alone, -1 where there is nothing to tell.
  int sub_group = -1;
  // Whose extensions it tells of: which of its matrix units may be tried (matrix_probe.h).
  std::vector<MatrixUnit> matrix_units;
  bool is_pocl = false;  // has a binary cache of its own
  // What one launch may be; a longer one goes to the device in parts (launch_parts.h).
  double most_flops = 2e10;         // operations: half a second at 40 GFLOP/s
  std::size_t most_groups = 65535;  // work-groups in the second and the third direction: NVIDIA's limit
  std::string lowered;              // what VSPLAT_LIMITS says (device_limits.h); empty: nothing
  std::optional<std::array<std::uint8_t, 16>> uuid;  // where the driver tells it
  std::optional<PciAddress> pci;
};

// Every device of every platform, in the loader's order. Empty where there is no platform.
std::vector<DeviceInfo> list_devices();

// Whether this process is a child of one that used OpenCL before it forked: drivers' threads do not live on in it.
bool is_forked();
// Error(device) then. The first use of OpenCL is noted here.
void refuse_after_fork();

// Of these, those that `spec` means: flat index ("0"), platform:device ("0:1"), type ("cpu", "gpu", "acc"), or a part
// of the name of a device, its platform or its vendor, whatever its case.
std::vector<DeviceInfo> that_match(const std::string& spec, const std::vector<DeviceInfo>& devices);

// The one that matches; of a type the first. Empty: $VSPLAT_DEVICE, else the first GPU, else the first device. Throws
// Error(device) with the list of what there is, or of those that match where several do; never picks another one.
DeviceInfo choose_device(const std::string& spec);

}  // namespace vsplat
