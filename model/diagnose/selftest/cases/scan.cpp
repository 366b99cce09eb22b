#include "model/diagnose/selftest/reference/scan.h"

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/render/scan.h"

namespace vsplat::selftest {
namespace {

void scan_of(Checks& c, long n, std::uint32_t bound) {
  std::mt19937 engine(static_cast<unsigned>(n));
  std::vector<std::uint32_t> in(size_of(n));
  for (auto& v : in) v = engine() % bound;
  const Tensor out = c.up({n + 1}, std::vector<std::uint32_t>(size_of(n + 1), 7));
  exclusive_scan(c.ctx, c.up({n}, in), out);
  c.equal("sums", out, ref::exclusive_scan(in));
}

// A block is 64 * 32 = 2048 elements; the second and third level begin at 2049 and 2048^2 + 1.
void scan_all(Checks& c) {
  for (const long n : c.some({1L, 3L, 63L, 64L, 65L, 1023L, 1024L, 1025L, 40001L},
                             {0L, 7L, 31L, 32L, 33L, 101L, 2047L, 2048L, 2049L, 4096L, 65537L}))
    scan_of(c, n, 1000);
  if (!c.all) return;
  scan_of(c, 2048L * 2048 + 5, 2);
  scan_of(c, 5000, 0xFFFFFFFFu);  // wraps around modulo 2^32
}

}  // namespace

VSPLAT_CASES(scan, {"scan", scan_all})

}  // namespace vsplat::selftest
