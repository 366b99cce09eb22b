#include "model/render/reserve.h"

#include <memory>

#include "runtime/error.h"
#include "runtime/system/host_memory.h"

namespace vsplat {

bool reserve_for(Context& ctx, const std::function<void(Context&)>& work) {
  const auto plan = [&]() -> std::unique_ptr<Context> {
    auto planner = ctx.planner();
    try {
      work(*planner);
    } catch (const Error& e) {
      if (e.status() != Status::memory) throw;
      return nullptr;
    }
    return planner;
  };
  const auto fits = [&](const std::unique_ptr<Context>& p) {
    if (!p || p->memory().reserved() > ctx.memory().limits().total) return false;
    const std::size_t more = p->memory().reserved() - ctx.memory().reserved();
    return ctx.planning() || !ctx.memory().limits().on_host || more + reserved_host_memory() <= host_memory_limit();
  };
  std::unique_ptr<Context> planner = plan();
  if (!fits(planner) || planner->memory().reserved() > ctx.memory().reserved()) {
    ctx.memory().trim();
    planner = plan();
  }
  if (!fits(planner)) return false;
  ctx.memory().commit(planner->memory());
  return true;
}

}  // namespace vsplat
