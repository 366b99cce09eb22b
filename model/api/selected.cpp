#include "model/api/selected.h"

#include "runtime/fail.h"

namespace vsplat::api {

long selected_of(double asked, double usual, const AnyConfig& config, const char* what) {
  if (!(asked >= 0 && asked <= 1))
    fail(Status::usage, "{} is {}: a share of the {}, 0 to 1, is expected", what, asked, config.selects());
  return static_cast<long>((asked > 0 ? asked : usual) * static_cast<double>(config.selectable()));
}

}  // namespace vsplat::api
