#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <numeric>

#include "model/io/scene/splat_file.h"
#include "model/io/scene/written_gaussians.h"
#include "runtime/files/output_file.h"

namespace vsplat {

void write_splat(const std::string& path, const Scene& scene) {
  Gaussians made;
  const Gaussians& g = volumes_to_write(path, scene.gaussians, made);
  std::vector<float> weight(g.count);
  for (std::size_t k = 0; k < g.count; ++k) {
    const float* s = &g.scales[3 * k];
    weight[k] = static_cast<float>(static_cast<double>(s[0]) * s[1] * s[2] * g.opacities[k]);
  }
  std::vector<std::size_t> order(g.count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return weight[a] > weight[b]; });
  OutputFile file(path);
  constexpr std::size_t kRowsAtOnce = 4096;  // written at a time
  std::vector<std::uint8_t> rows;
  for (std::size_t i = 0; i < g.count; ++i) {
    const std::size_t k = order[i], at = rows.size();
    rows.resize(at + splat::kRow);
    std::uint8_t* row = &rows[at];
    std::memcpy(row, &g.means[3 * k], 12);
    std::memcpy(row + 12, &g.scales[3 * k], 12);
    const float* sh = &g.sh[3 * k * g.sh_count()];
    for (std::size_t c = 0; c < 3; ++c)
      row[splat::kColour + c] = to_byte((0.5 + kShC0 * static_cast<double>(sh[c])) * 255);
    row[splat::kColour + 3] = to_byte(g.opacities[k] * 255.0);
    const UnitQuaternion q(&g.quats[4 * k]);
    for (std::size_t c = 0; c < 4; ++c) row[splat::kRotation + c] = to_byte(q.at[c] * 128 + 128);
    if (rows.size() < kRowsAtOnce * splat::kRow && i + 1 < g.count) continue;
    file.write(rows.data(), rows.size());
    rows.clear();
  }
  file.commit();
}

std::vector<std::string> splat_rounding(const Scene& scene) {
  const Gaussians& g = scene.gaussians;
  std::size_t beyond = 0;
  for (std::size_t k = 0; k < g.count; ++k)
    for (std::size_t c = 0; c < 3; ++c) {
      const double colour = 0.5 + kShC0 * static_cast<double>(g.sh[3 * k * g.sh_count() + c]);
      beyond += colour < -0.5 / 255 || colour > 1 + 0.5 / 255;  // nearer ones are only rounded
    }
  std::vector<std::string> out = {"colours and opacities are rounded to 1/255",
                                  "rotations are rounded to 1/128 in each part of the quaternion",
                                  "Gaussians are sorted by size and opacity"};
  if (beyond)
    out.push_back(fmt::format("{} colour value{} outside 0 to 1 {} clamped to it", beyond, beyond == 1 ? "" : "s",
                              beyond == 1 ? "is" : "are"));
  return out;
}

}  // namespace vsplat
