// Scenes: PLY, plain and compressed, .splat, SPZ, SOG and glTF.
#include <algorithm>
#include <cmath>
#include <span>

#include "model/io/scene/gltf_splats.h"
#include "model/io/scene/ply.h"
#include "model/io/scene/sog.h"
#include "model/io/scene/sog_meta.h"
#include "model/io/scene/splat_file.h"
#include "model/io/scene/spz.h"
#include "runtime/system/host_memory.h"
#include "tests/fuzz/targets.h"

namespace vsplat::fuzz {
namespace {

bool all_finite(const std::vector<float>& values) {
  return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
}

// SOG and glTF hold volumes of at most degree 3. Their files can name more Gaussians than there is memory for.
enum class Format { plain, packed };

void check(const Scene& scene, Format format) {
  const Gaussians& g = scene.gaussians;
  hold(g.sh_degree >= 0 && g.sh_degree <= (format == Format::packed ? 3 : 4), "degree");
  hold(format == Format::plain || g.kind == GaussianKind::volume, "kind");
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

constexpr std::size_t kSplatsMemory = std::size_t{64} << 20;

using Reader = Scene (*)(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped);

// Reads all Gaussians, and then those that can be drawn.
void read_twice(Reader read, const std::string& name, std::string_view bytes, Format format = Format::plain) {
  const auto content = std::as_bytes(std::span(bytes));
  const auto hold_error = [&](const Error& e) {
    if (format == Format::plain || e.status() != Status::memory) hold_message(e, name);
  };
  bool whole = true;
  Scene all;
  try {
    all = read(name, content, nullptr);
    check(all, format);
  } catch (const Error& e) {
    hold_error(e);
    whole = false;
  }
  try {
    SkippedGaussians skipped;
    const Scene scene = read(name, content, &skipped);
    check(scene, format);
    hold(whole == (skipped.total() == 0), "what is skipped is an error otherwise");
    hold(!whole || scene.gaussians.means == all.gaussians.means, "nothing else is skipped");
  } catch (const Error& e) {
    hold_error(e);
    hold(!whole, "skipping refuses no more");
  }
}

void read_packed(Reader read, std::string_view bytes) {
  set_host_memory_limit(kSplatsMemory);
  read_twice(read, "/nowhere/scene", bytes, Format::packed);
  set_host_memory_limit(0);
}

}  // namespace

void ply(std::string_view bytes) {
  static MemoryFile file;
  file.fill(bytes);
  const auto read = [](const std::string& path, std::span<const std::byte>, SkippedGaussians* skipped) {
    return read_ply(path, skipped);
  };
  read_twice(read, file.path(), bytes);
}

void splat(std::string_view bytes) { read_twice(read_splat, "a.splat", bytes); }
void spz(std::string_view bytes) { read_twice(read_spz, "a.spz", bytes); }
void sog(std::string_view bytes) { read_packed(read_sog, bytes); }
void gltf_splats(std::string_view bytes) { read_packed(read_gltf_scene, bytes); }

void sog_meta(std::string_view bytes) {
  try {
    const SogMeta meta = parse_sog_meta("/nowhere/scene", std::string(bytes));
    hold(meta.count > 0 && meta.degree >= 0 && meta.degree <= 3, "count and degree");
  } catch (const Error& e) {
    hold_message(e, "/nowhere/scene");
  }
}

}  // namespace vsplat::fuzz
