// Scene files written and read: the host's time alone, beside the device's streaming bandwidth, which no file reaches.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "bench/bench.h"
#include "bench/scenes.h"
#include "model/io/scene/scene_format.h"
#include "runtime/fail.h"

namespace vsplat::bench {

namespace {

namespace fs = std::filesystem;

fs::path new_folder() {
  std::random_device random;
  fs::path out = fs::temp_directory_path() / fmt::format("vsplat-bench-{:08x}{:08x}", random(), random());
  if (!fs::create_directory(out)) fail(Status::file, "{}: it is there already", out.string());
  return out;
}

struct SceneFileData {
  SceneFileData(const SceneFormat& kind, const std::string& name) : format(kind), scene(make_scene(name).scene) {
    const std::string_view endings = format.endings;
    path = folder / fmt::format("scene{}", endings.substr(0, endings.find(' ')));
  }
  SceneFileData(const SceneFileData&) = delete;
  SceneFileData& operator=(const SceneFileData&) = delete;
  ~SceneFileData() {
    std::error_code ignored;
    fs::remove_all(folder, ignored);
  }

  const SceneFormat& format;
  Scene scene, again;
  fs::path folder = new_folder(), path;
};

struct Bounds {
  std::array<double, 3> low, high, mean;
};

Bounds bounds_of(const Gaussians& g) {
  Bounds out{{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}, {0, 0, 0}};
  for (std::size_t i = 0; i < g.means.size(); ++i) {
    const double v = g.means[i];
    out.low[i % 3] = std::min(out.low[i % 3], v), out.high[i % 3] = std::max(out.high[i % 3], v);
    out.mean[i % 3] += v / static_cast<double>(g.count);
  }
  return out;
}

// The largest error of the positions' bounds and mean, which no order changes, relative to the scene's size.
double position_error(const Gaussians& read, const Gaussians& written) {
  if (read.count != written.count) return INFINITY;
  const Bounds a = bounds_of(read), b = bounds_of(written);
  double out = 0, size = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    size = std::max(size, b.high[c] - b.low[c]);
    for (const auto part : {&Bounds::low, &Bounds::high, &Bounds::mean})
      out = std::max(out, std::abs((a.*part)[c] - (b.*part)[c]));
  }
  return out / size;
}

double bytes_of(const Gaussians& g) {
  return static_cast<double>(sizeof(float) *
                             (g.means.size() + g.scales.size() + g.quats.size() + g.opacities.size() + g.sh.size()));
}

Prepared prepare(const SceneFormat& format, const std::string& name, bool writes) {
  const auto d = std::make_shared<SceneFileData>(format, name);
  format.write(d->path, d->scene, {});
  Prepared p;
  p.kind = Kind::memory;
  p.cost.bytes = bytes_of(d->scene.gaussians) + static_cast<double>(fs::file_size(d->path));
  if (writes)
    p.run = [d] { d->format.write(d->path, d->scene, {}); };
  else
    p.run = [d] { d->again = vsplat::read_scene(d->path); };
  p.error = [d] { return position_error(vsplat::read_scene(d->path).gaussians, d->scene.gaussians); };
  p.tolerance = 2e-3;  // of eleven bits for 256 neighbours
  return p;
}

}  // namespace

std::vector<Case> formats_cases(const Options&) {
  std::vector<Case> cases;
  for (const char* name : {"small-5k", "slab-1m"})
    for (const SceneFormat& format : scene_formats()) {
      if (!format.write || !format.read) continue;
      for (const bool writes : {true, false})
        cases.push_back({fmt::format("{}.{}.{}", name, format.name, writes ? "write" : "read"),
                         [&format, name, writes](Context&) { return prepare(format, name, writes); }});
    }
  return cases;
}

}  // namespace vsplat::bench
