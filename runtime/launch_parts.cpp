#include "runtime/launch_parts.h"

#include <algorithm>
#include <cmath>

#include "runtime/fail.h"
#include "runtime/rounding.h"

namespace vsplat {
namespace {

constexpr std::size_t kMostParts = 1 << 20;  // far more than any launch needs

// Whether one part is enough, as for nearly all launches.
bool is_one(const std::array<std::size_t, 3>& groups, const Cost& cost, const DeviceInfo& device) {
  return work_of(cost) <= device.most_flops && groups[1] <= device.most_groups && groups[2] <= device.most_groups;
}

// The first group of part i if `count` groups are divided into `parts` parts.
std::size_t begin_of(std::size_t i, std::size_t count, std::size_t parts) {
  return count / parts * i + std::min(i, count % parts);
}

}  // namespace

double work_of(const Cost& cost) {
  constexpr double each_byte = 10;
  return std::max({cost.performed > 0 ? cost.performed : cost.flops, cost.most, each_byte * cost.bytes});
}

std::vector<LaunchPart> parts_of(const KernelId& kernel, const Range& range, const Cost& cost,
                                 const DeviceInfo& device) {
  std::array<std::size_t, 3> size{}, groups{};
  for (std::size_t d = 0; d < 3; ++d) {
    size[d] = std::max<std::size_t>(range.local[d], 1);
    groups[d] = range.global[d] / size[d];
    if (device.address_bits < 64 && range.global[d] >> device.address_bits != 0)
      fail(Status::memory, "{}: {} work-items in direction {}, and {} has sizes of {} bits: choose another device",
           kernel.name, range.global[d], d, device.name, device.address_bits);
  }
  if (is_one(groups, cost, device)) return {{{0, 0, 0}, range.global, cost}};

  // Splits the last direction first, which keeps the groups in their order.
  std::array<std::size_t, 3> parts{1, 1, 1};
  for (std::size_t d = 1; d < 3; ++d) parts[d] = div_up(groups[d], device.most_groups);
  const double wanted = std::min(std::ceil(work_of(cost) / device.most_flops), static_cast<double>(kMostParts));
  for (std::size_t d = 3; d-- > 0;) {
    const std::size_t others = parts[0] * parts[1] * parts[2] / parts[d];
    const auto more = static_cast<std::size_t>(std::ceil(wanted / static_cast<double>(others)));
    parts[d] = std::max(parts[d], std::min(groups[d], more));
  }
  std::vector<LaunchPart> out;
  out.reserve(parts[0] * parts[1] * parts[2]);
  const double all = static_cast<double>(groups[0]) * static_cast<double>(groups[1]) * static_cast<double>(groups[2]);
  std::array<std::size_t, 3> at{};
  for (at[2] = 0; at[2] < parts[2]; ++at[2])
    for (at[1] = 0; at[1] < parts[1]; ++at[1])
      for (at[0] = 0; at[0] < parts[0]; ++at[0]) {
        LaunchPart part;
        double share = 1 / all;
        for (std::size_t d = 0; d < 3; ++d) {
          const std::size_t begin = begin_of(at[d], groups[d], parts[d]);
          const std::size_t count = begin_of(at[d] + 1, groups[d], parts[d]) - begin;
          part.offset[d] = begin * size[d];
          part.global[d] = count * size[d];
          share *= static_cast<double>(count);
        }
        part.cost = {cost.flops * share, cost.bytes * share, cost.performed * share, cost.most * share};
        out.push_back(part);
      }
  return out;
}

}  // namespace vsplat
