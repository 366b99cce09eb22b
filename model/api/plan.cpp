#include "model/api/plan.h"

#include <algorithm>

namespace vsplat::api {

vsplat_plan plan_of(const std::vector<StageMemory>& stages, std::size_t peak, std::size_t limit, bool fits) {
  vsplat_plan out = VSPLAT_PLAN_INIT;
  out.peak = peak;
  out.limit = limit;
  out.fits = fits && out.peak <= out.limit;
  out.num_stages = static_cast<uint32_t>(std::min<size_t>(stages.size(), VSPLAT_MAX_STAGES));
  for (uint32_t i = 0; i < out.num_stages; ++i) {
    const std::string name = stages[i].stage.empty() ? "model" : stages[i].stage;
    std::strncpy(out.stages[i].stage, name.c_str(), sizeof out.stages[i].stage - 1);
    out.stages[i].reserved = stages[i].peak_reserved;
    out.stages[i].live = stages[i].peak_live;
  }
  return out;
}

}  // namespace vsplat::api
