#include "model/ops/volume/compact.h"

#include "model/diagnose/selftest/cases/cases.h"

namespace vsplat::selftest {
namespace {

void compact_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 63L, 64L, 65L, 4099L}, {1009L})) {
    std::vector<std::uint32_t> flags(size_of(n));
    std::mt19937 engine(3);
    for (auto& f : flags) f = engine() % 3 == 0;
    flags.back() = 1;
    std::vector<int> want;
    for (std::size_t i = 0; i < flags.size(); ++i)
      if (flags[i]) want.push_back(static_cast<int>(i));
    c.equal("indices", compact(c.ctx, c.up({n}, flags), 0), want);
  }
}

}  // namespace

VSPLAT_CASES(compact, {"compact", compact_all})

}  // namespace vsplat::selftest
