#include "model/networks/layers/running.h"

#include "runtime/fail.h"
#include "runtime/option.h"
#include "runtime/units.h"

namespace vsplat {

void refuse_unless_fits(const Context& plan, const std::string& what) {
  const ArenaLimits& limits = plan.memory().limits();
  if (plan.memory().peak() <= limits.total) return;
  fail(Status::memory,
       "not enough device memory for {}: {:.4g} GiB needed, {:.4g} GiB may be used "
       "({}, fewer views, a smaller model or another device)",
       what, gib(plan.memory().peak()), gib(limits.total), Option::max_memory);
}

}  // namespace vsplat
