#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "model/io/scene/ply.h"
#include "model/io/scene/ply_comments.h"
#include "runtime/fail.h"
#include "runtime/files/output_file.h"

namespace vsplat {
namespace {

constexpr std::size_t kRows = 4096;  // Gaussians converted at a time
// The sigmoid (exponential) of these is 0 or 1 (0) in float arithmetic, and every reader accepts them.
constexpr float kLogitOfOne = 40, kLogitOfZero = -110, kLogOfZero = -110;

// "x", "f_rest_12", ... in output order. Surfels have no scale_2, which is how readers identify them.
std::vector<std::string> property_names(std::size_t sh_count, int scales) {
  std::vector<std::string> names{"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"};
  for (std::size_t i = 0; i < 3 * (sh_count - 1); ++i) names.push_back(fmt::format("f_rest_{}", i));
  names.emplace_back("opacity");
  for (int i = 0; i < scales; ++i) names.push_back(fmt::format("scale_{}", i));
  for (const char* name : {"rot_0", "rot_1", "rot_2", "rot_3"}) names.emplace_back(name);
  return names;
}

std::string make_header(const Scene& scene, const std::vector<std::string>& names) {
  std::string out = "ply\nformat binary_little_endian 1.0\n";
  out += comments_of(scene);
  out += fmt::format("comment SH degree: {}\n", scene.gaussians.sh_degree);
  out += fmt::format("element vertex {}\n", scene.gaussians.count);
  for (const std::string& name : names) out += "property float " + name + "\n";
  return out + "end_header\n";
}

float logit(float opacity) {
  if (opacity >= 1) return kLogitOfOne;
  if (opacity <= 0) return kLogitOfZero;
  const double o = opacity;
  return static_cast<float>(std::log(o) - std::log1p(-o));
}

// Writes one row in the order of property_names().
void put_row(const Gaussians& g, std::size_t k, float* out) {
  const float* mean = &g.means[3 * k];
  const float* sh = &g.sh[3 * k * g.sh_count()];
  const float* q = &g.quats[4 * k];
  for (int i = 0; i < 3; ++i) *out++ = mean[i];
  for (int i = 0; i < 3; ++i) *out++ = 0;  // some viewers expect normals
  for (int i = 0; i < 3; ++i) *out++ = sh[i];
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t i = 1; i < g.sh_count(); ++i) *out++ = sh[3 * i + c];
  *out++ = std::isnan(g.opacities[k]) ? g.opacities[k] : logit(g.opacities[k]);
  const auto scales = static_cast<std::size_t>(scales_of(g.kind));
  for (std::size_t i = 0; i < scales; ++i) {
    const float s = g.scales[scales * k + i];
    *out++ = s > 0 ? static_cast<float>(std::log(static_cast<double>(s))) : s == 0 ? kLogOfZero : std::nanf("");
  }
  double norm = 0;
  for (int i = 0; i < 4; ++i) norm += static_cast<double>(q[i]) * q[i];
  norm = std::sqrt(norm);
  for (int i = 0; i < 4; ++i) *out++ = norm == 0 ? (i == 0 ? 1.0f : 0.0f) : static_cast<float>(q[i] / norm);
}

}  // namespace

void write_ply(const std::string& path, const Scene& scene) {
  const Gaussians& g = scene.gaussians;
  const std::vector<std::string> names = property_names(g.sh_count(), scales_of(g.kind));
  const std::string header = make_header(scene, names);
  OutputFile file(path);
  file.write(header);
  const std::size_t width = names.size();
  std::vector<float> rows(std::min(kRows, g.count) * width);
  for (std::size_t first = 0; first < g.count; first += kRows) {
    const std::size_t count = std::min(kRows, g.count - first);
    for (std::size_t i = 0; i < count; ++i) put_row(g, first + i, &rows[i * width]);
    for (std::size_t i = 0; i < count * width; ++i)
      if (!std::isfinite(rows[i]))
        fail(Status::input, "{}: Gaussian {}: its {} would be {}: nothing is written", path, first + i / width,
             names[i % width], rows[i]);
    file.write(rows.data(), count * width * sizeof(float));
  }
  file.commit();
}

}  // namespace vsplat
