#include "model/render/reserve.h"

#include <algorithm>
#include <memory>

#include "runtime/error.h"
#include "runtime/system/host_memory.h"

namespace vsplat {
namespace {

bool half_is_free(const Context& ctx) {
  const Arena& memory = ctx.memory();
  return 2 * memory.reserved() <= memory.limits().total &&
         (!memory.limits().on_host || memory.reserved() + reserved_host_memory() <= host_memory_limit());
}

}  // namespace

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

bool RepeatedWork::reserve(Context& ctx, const std::array<std::uint64_t, 4>& sizes,
                           const std::function<void(Context&)>& work) {
  if (ctx.planning()) return reserve_for(ctx, work);
  bool fitted = reserved_ > 0 && ctx.memory().reserved() >= reserved_ && half_is_free(ctx);
  for (std::size_t i = 0; i < sizes.size(); ++i) fitted = fitted && sizes[i] <= most_[i];
  if (fitted) return true;
  if (!reserve_for(ctx, work)) return false;
  for (std::size_t i = 0; i < sizes.size(); ++i) most_[i] = std::max(most_[i], sizes[i]);
  reserved_ = ctx.memory().reserved();
  return true;
}

}  // namespace vsplat
