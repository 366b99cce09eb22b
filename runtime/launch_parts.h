// Splits a launch that is too long for a device into parts, which run one after the other. Kernels learn a part's place
// from its offset (GROUP_ID in cl/common.clh), so the result does not depend on the split. Long launches would delay a
// cancelled run and freeze a screen for its other users, and graphics drivers kill them.
#pragma once
#include <vector>

#include "runtime/device.h"
#include "runtime/launch.h"

namespace vsplat {

struct LaunchPart {
  std::array<std::size_t, 3> offset{}, global{};
  Cost cost;  // in proportion to its share of the launch's groups
};

// The time that a launch takes, as a number of operations: a moved byte counts as ten.
double work_of(const Cost& cost);

// The parts, in launch order and nearly equal. Each has at most DeviceInfo::most_flops of work, as far as whole groups
// allow (a part has at least one), and at most most_groups groups in the second and the third direction. Error(memory)
// if an index exceeds the device's size type.
std::vector<LaunchPart> parts_of(const KernelId& kernel, const Range& range, const Cost& cost,
                                 const DeviceInfo& device);

}  // namespace vsplat
