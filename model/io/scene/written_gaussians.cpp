#include "model/io/scene/written_gaussians.h"

#include <limits>
#include <vector>

#include "model/base/scene.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

void check(const std::string& path, const char* field, const std::vector<float>& values, std::size_t each, float least,
           float most) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!(values[i] >= least && values[i] <= most))
      fail(Status::input, "{}: Gaussian {}: {} in its {}: {} expected; nothing is written", path, i / each, values[i],
           field,
           most == 1    ? "0 to 1"
           : least == 0 ? "a finite number from 0 up"
                        : "a finite number");
}

}  // namespace

const Gaussians& volumes_to_write(const std::string& path, const Gaussians& given, Gaussians& made) {
  constexpr float most = std::numeric_limits<float>::max();
  const auto scales = static_cast<std::size_t>(scales_of(given.kind));
  if (given.count == 0) fail(Status::input, "{}: a scene without Gaussians can only be written as a PLY", path);
  check(path, "mean", given.means, 3, -most, most);
  check(path, "scales", given.scales, scales, 0, most);
  check(path, "rotation", given.quats, 4, -most, most);
  check(path, "opacity", given.opacities, 1, 0, 1);
  check(path, "spherical harmonics", given.sh, 3 * given.sh_count(), -most, most);
  if (given.kind == GaussianKind::volume) return given;
  made = thickened(given, kWrittenThickness);
  return made;
}

UnitQuaternion::UnitQuaternion(const float* from) {
  double norm = 0;
  for (int i = 0; i < 4; ++i) norm += static_cast<double>(from[i]) * from[i];
  norm = std::sqrt(norm);
  for (int i = 0; i < 4; ++i) at[i] = norm > 0 ? from[i] / norm : i == 0 ? 1 : 0;
}

}  // namespace vsplat
