#include <string>

#include "model/diagnose/selftest/cases/cases.h"
#include "runtime/tuning/tuning.h"

namespace vsplat::selftest {
namespace {

// What peaks are measured with: s = (j + i), then s = s b + a, k times.
void peak_all(Checks& c) {
  const int width = c.ctx.flavour() == Flavour::cpu ? 16 : 4, chains = c.ctx.flavour() == Flavour::cpu ? 24 : 8;
  const long n = 13;
  const Tensor out = c.gap({n, width});
  const std::string defines = "-DWIDTH=" + std::to_string(width);
  c.ctx.launch({"peak", "peak_fma", defines + " -DCHAINS=" + std::to_string(chains)}, items(n, 1), {}, 5L, 0.9f,
               written(out));
  std::vector<double> want;
  for (long i = 0; i < n; ++i) {
    double sum = 0;
    for (int j = 0; j < chains; ++j) {
      double s = static_cast<double>(i + j);
      for (int k = 0; k < 5; ++k) s = s * static_cast<double>(0.9f * 0.5f) + static_cast<double>(0.9f);
      sum += s;
    }
    want.insert(want.end(), static_cast<std::size_t>(width), sum);
  }
  c.close("multiply-adds", out, want, 1e-6);
  const auto a = random_floats(size_of(n, width), 1), b = random_floats(size_of(n, width), 2);
  std::vector<double> stream;
  for (std::size_t i = 0; i < a.size(); ++i) stream.push_back(a[i] + 0.5 * static_cast<double>(b[i]));
  const Tensor y = c.gap({n, width});
  c.ctx.launch({"peak", "peak_stream", defines}, items(n, 64), {}, n, 0.5f, c.up({n, width}, a), c.up({n, width}, b),
               written(y));
  c.close("stream", y, stream, 1e-6);
}

}  // namespace

VSPLAT_CASES(peak, {"peak", peak_all})

}  // namespace vsplat::selftest
