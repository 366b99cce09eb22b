#include "model/networks/network.h"

namespace vsplat {

std::unique_ptr<Network> make_network(Context& ctx, const AnyConfig& config, const WeightSource& weights) {
  return config.visit([&](const auto& c) { return network_of(ctx, c, weights); });
}

MemoryPlan plan_network(const Context& ctx, const AnyConfig& config, const Weights& weights, long views,
                        long selected) {
  const auto planner = ctx.planner();
  return make_network(*planner, config, weights)->plan(*planner, views, selected);
}

}  // namespace vsplat
