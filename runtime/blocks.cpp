#include "runtime/blocks.h"

namespace vsplat {

std::vector<long> block_starts(const Context& ctx, long count, long block) {
  // The first block grows the arena; from the second on, pieces lie at their final places.
  constexpr long kPlanned = 3;
  std::vector<long> out;
  const long blocks = (count + block - 1) / block;
  for (long i = 0; i < blocks; ++i) {
    if (ctx.planning() && i == kPlanned && blocks > kPlanned) i = blocks - 1;
    out.push_back(i * block);
  }
  return out;
}

}  // namespace vsplat
