// Scene files other than PLY: SOG and glTF.
#include <algorithm>
#include <cmath>
#include <functional>
#include <span>

#include "model/io/scene/gltf_splats.h"
#include "model/io/scene/sog.h"
#include "model/io/scene/sog_meta.h"
#include "runtime/system/host_memory.h"
#include "tests/fuzz/targets.h"

namespace vsplat::fuzz {
namespace {

constexpr std::size_t kSplatsMemory = std::size_t{64} << 20;

bool finite(const std::vector<float>& values) {
  return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
}

void check_splats(const Scene& scene) {
  const Gaussians& g = scene.gaussians;
  hold(g.sh_degree >= 0 && g.sh_degree <= 3 && g.kind == GaussianKind::volume, "degree and kind");
  hold(g.means.size() == 3 * g.count && g.scales.size() == 3 * g.count && g.quats.size() == 4 * g.count, "sizes");
  hold(g.opacities.size() == g.count && g.sh.size() == 3 * g.count * g.sh_count(), "sizes");
  hold(finite(g.means) && finite(g.scales) && finite(g.sh), "finite");
  for (const float s : g.scales) hold(s >= 0, "scales are not negative");
  for (const float o : g.opacities) hold(o >= 0 && o <= 1, "opacities are shares");
  for (std::size_t k = 0; k < g.count; ++k) {
    double norm = 0;
    for (std::size_t i = 0; i < 4; ++i) norm += std::pow(static_cast<double>(g.quats[4 * k + i]), 2);
    hold(std::abs(norm - 1) < 1e-5, "rotations have length 1");
  }
  hold(std::isfinite(scene.near) && scene.near >= 0, "near plane");
}

using ReadSplats = Scene (*)(const std::string&, std::span<const std::byte>, SkippedGaussians*);

void read_splats(ReadSplats read, std::string_view bytes) {
  const std::string name = "/nowhere/scene";
  const auto content = std::as_bytes(std::span(bytes));
  set_host_memory_limit(kSplatsMemory);
  bool whole = true;
  Scene all;
  try {
    all = read(name, content, nullptr);
    check_splats(all);
  } catch (const Error& e) {
    if (e.status() != Status::memory) hold_message(e, name);
    whole = false;
  }
  try {
    SkippedGaussians skipped;
    const Scene scene = read(name, content, &skipped);
    check_splats(scene);
    hold(whole == (skipped.total() == 0), "what is skipped is an error otherwise");
    hold(!whole || scene.gaussians.means == all.gaussians.means, "nothing else is skipped");
  } catch (const Error& e) {
    if (e.status() != Status::memory) hold_message(e, name);
    hold(!whole, "skipping refuses no more");
  }
  set_host_memory_limit(0);
}

}  // namespace

void sog(std::string_view bytes) { read_splats(read_sog, bytes); }

void sog_meta(std::string_view bytes) {
  try {
    const SogMeta meta = parse_sog_meta("/nowhere/scene", std::string(bytes));
    hold(meta.count > 0 && meta.degree >= 0 && meta.degree <= 3, "count and degree");
  } catch (const Error& e) {
    hold_message(e, "/nowhere/scene");
  }
}

void gltf_splats(std::string_view bytes) { read_splats(read_gltf_scene, bytes); }

}  // namespace vsplat::fuzz
