// What a planner notes: launches by kernel, and the memory of stages.
#pragma once
#include <array>
#include <compare>
#include <cstddef>
#include <map>
#include <set>
#include <string>

namespace vsplat {

// Identifies a kernel by the fields of its KernelId.
struct NamedKernel {
  std::string file, name, defines;
  auto operator<=>(const NamedKernel&) const = default;  // NOLINT(modernize-use-nullptr): it has none
};

// A launch that a planner has noted: the size of its work-groups (0: the driver's choice), and the local memory of its
// arguments, without what the kernel itself declares.
struct NotedLaunch {
  std::string stage;
  std::array<std::size_t, 3> group{};
  std::size_t local_bytes = 0;
  auto operator<=>(const NotedLaunch&) const = default;  // NOLINT(modernize-use-nullptr): it has none
};
struct NotedKernel {
  std::set<NotedLaunch> launches;
  double work = 0;              // of the longest part of a launch (launch_parts.h)
  std::size_t most_groups = 0;  // largest number of groups of a part in the second or third direction
};
using NotedKernels = std::map<NamedKernel, NotedKernel>;

// Peak device memory during a stage: bytes of slabs, and of live tensors in them.
struct StageMemory {
  std::string stage;
  std::size_t peak_reserved = 0, peak_live = 0;
};

}  // namespace vsplat
