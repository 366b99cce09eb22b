#include "model/api/plan.h"

#include <algorithm>
#include <cstring>

#include "runtime/system/host_memory.h"

namespace vsplat::api {

vsplat_plan plan_of(const Context& ctx, const std::vector<StageMemory>& stages, std::size_t peak, bool fits,
                    double host) {
  vsplat_plan out = VSPLAT_PLAN_INIT;
  out.peak = peak;
  out.limit = ctx.memory().limits().total;
  out.host_peak = static_cast<uint64_t>(host);
  out.host_limit = host_memory_limit();
  const bool shared = ctx.device().type == DeviceType::cpu;
  out.fits = fits && out.peak <= out.limit &&
             host + (shared ? static_cast<double>(peak) : 0.0) <= static_cast<double>(out.host_limit);
  for (const StageMemory& from : stages) {  // a stage that occurs twice (coarse heads, fine heads) is one row
    const std::string name = from.stage.empty() ? "model" : from.stage;
    vsplat_stage_memory* const end = out.stages + out.num_stages;
    vsplat_stage_memory* const to =
        std::find_if(out.stages, end, [&](const vsplat_stage_memory& s) { return name == s.stage; });
    if (to == end) {
      if (out.num_stages == VSPLAT_MAX_STAGES) break;
      std::strncpy(to->stage, name.c_str(), sizeof to->stage - 1);
      ++out.num_stages;
    }
    to->reserved = std::max<uint64_t>(to->reserved, from.peak_reserved);
    to->live = std::max<uint64_t>(to->live, from.peak_live);
  }
  return out;
}

}  // namespace vsplat::api
