#include "model/networks/params/parameter.h"

#include <fmt/ranges.h>

#include "runtime/fail.h"

namespace vsplat {

long Parameter::count() const {
  long n = 1;
  for (const long side : shape) n *= side;
  return n;
}

void require_shape(const Parameter& parameter, const Shape& found) {
  if (found != parameter.shape)
    fail(Status::format, "{} is [{}], the configuration makes it [{}]", parameter.name, fmt::join(found, ", "),
         fmt::join(parameter.shape, ", "));
}

}  // namespace vsplat
