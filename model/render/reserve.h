// Reserves exactly the memory that work needs, before it runs.
#pragma once
#include <array>
#include <cstdint>
#include <functional>

#include "runtime/context.h"

namespace vsplat {

// Runs `work` on a planning context, then reserves the memory that the plan used. Frees unused memory if that helps.
// Returns false, with nothing reserved, if the work would exceed the memory limit.
bool reserve_for(Context& ctx, const std::function<void(Context&)>& work);

// The same for work that is repeated with other sizes. It is not planned again where none of its sizes is above those
// that fitted before and half of the memory is free: a plan takes the host 0.2 ms, in which the device may have nothing
// to do.
class RepeatedWork {
 public:
  bool reserve(Context& ctx, const std::array<std::uint64_t, 4>& sizes, const std::function<void(Context&)>& work);

 private:
  std::array<std::uint64_t, 4> most_{};  // of each size
  std::size_t reserved_ = 0;             // bytes after the last plan; 0: none
};

}  // namespace vsplat
