// Devices together with their OpenCL handles, for runtime's sources only.
#pragma once
#include <vector>

#include "runtime/device.h"
#include "runtime/opencl.h"

namespace vsplat {

struct FoundDevice {
  DeviceInfo info;
  cl::Device handle;
};

// list_devices(), with OpenCL handles.
std::vector<FoundDevice> find_devices();

}  // namespace vsplat
