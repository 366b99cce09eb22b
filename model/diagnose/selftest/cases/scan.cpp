#include "model/diagnose/selftest/reference/scan.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/render/scan.h"

namespace vsplat::selftest {
namespace {

void scan_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 63L, 64L, 65L, 1023L, 1024L, 1025L, 40001L})) {
    std::mt19937 engine(static_cast<unsigned>(n));
    std::vector<std::uint32_t> in(size_of(n));
    for (auto& v : in) v = engine() % 1000;
    const Tensor out = c.up({n + 1}, std::vector<std::uint32_t>(size_of(n + 1), 7));
    exclusive_scan(c.ctx, c.up({n}, in), out);
    c.equal("sums", out, ref::exclusive_scan(in));
  }
}

}  // namespace

VSPLAT_CASES(scan, {"scan", scan_all})

}  // namespace vsplat::selftest
