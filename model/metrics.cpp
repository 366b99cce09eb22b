#include "model/metrics.h"

#include <cmath>

#include "runtime/error.h"

namespace vsplat {

double psnr(const Image& a, const Image& b) {
  if (a.width != b.width || a.height != b.height || a.channels != b.channels || a.empty())
    fail(Status::input, "pictures of {} x {} x {} and {} x {} x {} cannot be compared", a.width, a.height, a.channels,
         b.width, b.height, b.channels);
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    const double d = static_cast<double>(a.data[i]) - b.data[i];
    sum += d * d;
  }
  return -10 * std::log10(sum / static_cast<double>(a.data.size()));
}

}  // namespace vsplat
