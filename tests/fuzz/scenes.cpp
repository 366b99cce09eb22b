// Scenes: PLY, plain and compressed, .splat and SPZ.
#include <algorithm>
#include <cmath>
#include <span>

#include "model/io/scene/ply.h"
#include "model/io/scene/splat_file.h"
#include "model/io/scene/spz.h"
#include "tests/fuzz/targets.h"

namespace vsplat::fuzz {
namespace {

bool all_finite(const std::vector<float>& values) {
  return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
}

void check(const Scene& scene) {
  const Gaussians& g = scene.gaussians;
  hold(g.sh_degree >= 0 && g.sh_degree <= 4, "degree");
  const auto scales = static_cast<std::size_t>(scales_of(g.kind));
  hold(g.means.size() == 3 * g.count && g.scales.size() == scales * g.count && g.quats.size() == 4 * g.count, "sizes");
  hold(g.opacities.size() == g.count && g.sh.size() == 3 * g.count * g.sh_count(), "sizes");
  hold(all_finite(g.means) && all_finite(g.scales) && all_finite(g.sh), "finite");
  for (const float s : g.scales) hold(s >= 0, "scales are not negative");
  for (const float o : g.opacities) hold(o >= 0 && o <= 1, "opacities are shares");
  for (std::size_t k = 0; k < g.count; ++k) {
    double norm = 0;
    for (std::size_t i = 0; i < 4; ++i) norm += std::pow(static_cast<double>(g.quats[4 * k + i]), 2);
    hold(std::abs(norm - 1) < 1e-5, "rotations have length 1");
  }
  hold(std::isfinite(scene.near) && scene.near >= 0, "near plane");
  for (int i = 0; scene.mirror && i < 3; ++i) hold(std::isfinite((*scene.mirror)[i]), "mirror");
}

using Reader = Scene (*)(const std::string& name, std::string_view bytes, SkippedGaussians* skipped);

// Reads all Gaussians, and then those that can be drawn.
void read_twice(Reader read, const std::string& name, std::string_view bytes) {
  bool whole = true;
  Scene all;
  try {
    all = read(name, bytes, nullptr);
    check(all);
  } catch (const Error& e) {
    hold_message(e, name);
    whole = false;
  }
  try {
    SkippedGaussians skipped;
    const Scene scene = read(name, bytes, &skipped);
    check(scene);
    hold(whole == (skipped.total() == 0), "what is skipped is an error otherwise");
    hold(!whole || scene.gaussians.means == all.gaussians.means, "nothing else is skipped");
  } catch (const Error& e) {
    hold_message(e, name);
    hold(!whole, "skipping refuses no more");
  }
}

std::span<const std::byte> content(std::string_view bytes) { return std::as_bytes(std::span(bytes)); }

}  // namespace

void ply(std::string_view bytes) {
  static MemoryFile file;
  file.fill(bytes);
  const auto read = [](const std::string& path, std::string_view, SkippedGaussians* skipped) {
    return read_ply(path, skipped);
  };
  read_twice(read, file.path(), bytes);
}

void splat(std::string_view bytes) {
  const auto read = [](const std::string& name, std::string_view from, SkippedGaussians* skipped) {
    return read_splat(name, content(from), skipped);
  };
  read_twice(read, "a.splat", bytes);
}

void spz(std::string_view bytes) {
  const auto read = [](const std::string& name, std::string_view from, SkippedGaussians* skipped) {
    return read_spz(name, content(from), skipped);
  };
  read_twice(read, "a.spz", bytes);
}

}  // namespace vsplat::fuzz
