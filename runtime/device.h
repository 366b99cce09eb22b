// The OpenCL devices, what they can do, and how a user names one.
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

// A device's place on the PCI bus.
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
  bool local_is_fast = false;      // dedicated local memory, not a part of global memory
  std::size_t max_work_group = 1;  // in the first direction; our kernels use no other
  int compute_units = 1;
  int native_float_width = 1;    // less than 4: its compiler splits vectors into scalars
  int align = 128;               // bytes; sub-buffers start at multiples of it
  int address_bits = 64;         // of the device's sizes
  bool event_profiling = false;  // device events carry times
  bool fp16 = false, fp64 = false, subgroups = false;
  // The sub-group size to request of a GPU's compiler (-DSUB_GROUP): the smallest one that fills the GPU's vectors. 0:
  // leave the choice to the compiler; -1: the compiler takes no such request.
  int sub_group = -1;
  // Matrix units that the device's extensions announce, or of a CPU device the processor, and that may be tried
  // (matrix_probe.h).
  std::vector<MatrixUnit> matrix_units;
  bool is_pocl = false;  // has a binary cache of its own
  // Limits of one launch; a longer launch goes to the device in parts (launch_parts.h).
  double most_flops = 2e10;         // operations: half a second at 40 GFLOP/s
  std::size_t most_groups = 65535;  // work-groups in the second and the third direction: NVIDIA's limit
  std::string lowered;              // value of VSPLAT_LIMITS (device_limits.h); empty if unset
  std::optional<std::array<std::uint8_t, 16>> uuid;  // if the driver reports it
  std::optional<PciAddress> pci;
};

// Every device of every platform, in the loader's order. Empty without a platform.
std::vector<DeviceInfo> list_devices();

// Whether this process was forked from one that had used OpenCL: the drivers' threads do not exist in it.
bool is_forked();
// Throws Error(device) if is_forked(). The first call notes the process that uses OpenCL.
void refuse_after_fork();

// The devices that `spec` matches: flat index ("0"), platform:device ("0:1"), type ("cpu", "gpu", "acc"), or a part of
// the name of a device, its platform or its vendor, in upper or lower case.
std::vector<DeviceInfo> that_match(const std::string& spec, const std::vector<DeviceInfo>& devices);

// The device that `spec` matches; for a type, the first one of it. Empty: $VSPLAT_DEVICE, else the first GPU, else the
// first device. Throws Error(device) with the list of devices if none matches, or of the matching ones if several do;
// never picks a different device.
DeviceInfo choose_device(const std::string& spec);

}  // namespace vsplat
