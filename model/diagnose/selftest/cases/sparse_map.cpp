#include "model/diagnose/selftest/reference/sparse_map.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/voxels.h"
#include "model/ops/volume/sparse_map.h"

namespace vsplat::selftest {
namespace {

void sparse_map_all(Checks& c) {
  for (const int r : c.some({1, 3, 5, 9}, {2, 7, 8})) {
    const auto voxels = some_voxels(r, r == 8 ? 1.0f : 0.3f);  // 8: all, so that some have 27 neighbours
    const long p = static_cast<long>(voxels.size());
    const Tensor map = c.up({p, 27}, std::vector<int>(voxels.size() * 27, -7));
    sparse_map_forward(c.ctx, {c.up({p}, voxels), r, map});
    c.equal("map", map, ref::sparse_map(voxels, r));
  }
}

}  // namespace

VSPLAT_CASES(sparse_map, {"sparse_map", sparse_map_all})

}  // namespace vsplat::selftest
