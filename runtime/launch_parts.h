// A launch that is more than a device should take at once, in parts, one behind the other: kernels learn of the part's
// place by its offset (GROUP_ID in cl/common.clh), so that what they compute is the same whichever parts there are.
// Long launches would keep whoever tells a run to stop waiting, and other users of a screen; graphics drivers end them.
#pragma once
#include <vector>

#include "runtime/device.h"
#include "runtime/launch.h"

namespace vsplat {

struct LaunchPart {
  std::array<std::size_t, 3> offset{}, global{};
  Cost cost;  // by its share of the launch's groups
};

// How long a launch takes, in operations that would take as long: a byte that moves counts as ten.
double work_of(const Cost& cost);

// In the order in which they are launched; nearly equal, with no more work than DeviceInfo::most_flops each where
// groups can be dealt out so (no part is less than one), and no more than most_groups of these in the second and the
// third direction. Error(memory) where an index is beyond the device's sizes.
std::vector<LaunchPart> parts_of(const KernelId& kernel, const Range& range, const Cost& cost,
                                 const DeviceInfo& device);

}  // namespace vsplat
