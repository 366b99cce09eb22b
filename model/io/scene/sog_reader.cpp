#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>

#include "model/io/archive/memory_zip.h"
#include "model/io/scene/sog.h"
#include "model/io/scene/sog_meta.h"
#include "model/io/scene/webp_plane.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/printable.h"
#include "runtime/system/host_memory.h"

namespace vsplat {
namespace {

constexpr std::size_t kVectorsInRow = 64;  // of the palette's plane
// A plane of equal texels has hardly any bytes. No scene has so many Gaussians for its bytes.
constexpr std::size_t kGaussiansForByte = 1024;
// Texels that a plane may have beyond four times its Gaussians.
constexpr std::size_t kSpareTexels = 65536;

// Returns the bytes of a file of this name.
using SogFiles = std::function<std::vector<unsigned char>(const std::string&)>;

std::size_t coefficients_of(int degree) { return static_cast<std::size_t>((degree + 1) * (degree + 1) - 1); }

// The vectors of spherical harmonics, and each Gaussian's.
struct Palette {
  WebpPlane centroids, labels;
  std::size_t size = 0, coefficients = 0;

  // The texel of coefficient `j` of a Gaussian's vector; null if it has none.
  const std::uint8_t* at(std::size_t k, std::size_t j) const {
    const std::uint8_t* label = labels.at(k);
    const std::size_t vector = label[0] | static_cast<std::size_t>(label[1]) << 8;
    if (vector >= size) return nullptr;
    const std::size_t x = vector % kVectorsInRow * coefficients + j, y = vector / kVectorsInRow;
    return centroids.at(y * static_cast<std::size_t>(centroids.width) + x);
  }
};

class SogReader {
 public:
  SogReader(std::string name, const SogFiles& files, std::size_t bytes, SkippedGaussians* skipped)
      : name_(std::move(name)), files_(files), skips_(name_, skipped) {
    const std::vector<unsigned char> text = files("meta.json");
    meta_ = parse_sog_meta(name_ + ": meta.json", {text.begin(), text.end()});
    if (bytes && meta_.count / kGaussiansForByte > bytes)
      fail(Status::format, "{}: meta.json: {} Gaussians in a file of {} bytes: it is damaged, or made to use up memory",
           name_, meta_.count, bytes);
  }

  Scene read() {
    const WebpPlane low = plane(meta_.means_low), high = plane(meta_.means_high), scales = plane(meta_.scales_file),
                    quats = plane(meta_.quats_file), sh0 = plane(meta_.sh0_file);
    if (meta_.has_sh) read_palette();
    Scene scene = meta_.scene;
    Gaussians& g = scene.gaussians;
    g.sh_degree = meta_.degree;
    const std::size_t numbers = 3 + 3 + 4 + 1 + 3 * g.sh_count();
    const HostMemory reserved(name_ + ": its Gaussians", 4.0 * static_cast<double>(numbers * meta_.count));
    g.means.reserve(3 * meta_.count);
    g.scales.reserve(3 * meta_.count);
    g.quats.reserve(4 * meta_.count);
    g.opacities.reserve(meta_.count);
    g.sh.reserve(3 * g.sh_count() * meta_.count);
    for (std::size_t k = 0; k < meta_.count; ++k) {
      if (!add_mean(k, low.at(k), high.at(k), g) || !add_scale(k, scales.at(k), g) || !add_sh(k, sh0.at(k), g)) {
        g.means.resize(3 * g.count);
        g.scales.resize(3 * g.count);
        g.sh.resize(3 * g.sh_count() * g.count);
        continue;
      }
      add_rotation(quats.at(k), g);
      g.opacities.push_back(meta_.opacities[sh0.at(k)[3]]);
      ++g.count;
    }
    skips_.report(meta_.count);
    return scene;
  }

 private:
  WebpPlane plane(const std::string& file) const {
    return decode_webp_plane(name_ + ": " + printable(file), files_(file), meta_.count, 4 * meta_.count + kSpareTexels);
  }

  void read_palette() {
    const std::string what = name_ + ": " + printable(meta_.centroids_file);
    palette_.centroids = decode_webp_plane(what, files_(meta_.centroids_file), 1, 65536 * coefficients_of(3));
    const auto width = static_cast<std::size_t>(palette_.centroids.width);
    const auto height = static_cast<std::size_t>(palette_.centroids.height);
    for (int degree = 1; degree <= 3 && meta_.degree == 0; ++degree)
      if (width == kVectorsInRow * coefficients_of(degree)) meta_.degree = degree;
    if (meta_.degree == 0)
      fail(Status::format, "{}: {} texels wide: 192, 512 or 960 are expected, for degree 1, 2 or 3", what, width);
    palette_.coefficients = coefficients_of(meta_.degree);
    if (width != kVectorsInRow * palette_.coefficients)
      fail(Status::format, "{}: {} texels wide: {} are expected for degree {}", what, width,
           kVectorsInRow * palette_.coefficients, meta_.degree);
    palette_.size = meta_.palette ? meta_.palette : kVectorsInRow * height;
    if (palette_.size > kVectorsInRow * height)
      fail(Status::format, "{}: {} texels high: shN.count is {}, for which {} are expected", what, height,
           palette_.size, (palette_.size + kVectorsInRow - 1) / kVectorsInRow);
    palette_.labels = plane(meta_.labels_file);
  }

  bool add_mean(std::size_t k, const std::uint8_t* low, const std::uint8_t* high, Gaussians& g) {
    for (std::size_t i = 0; i < 3; ++i) {
      const int v = low[i] | high[i] << 8;
      const double l = meta_.mins[i] + (meta_.maxs[i] - meta_.mins[i]) * v / 65535;
      const double x = std::copysign(std::expm1(std::abs(l)), l);
      if (!(std::abs(x) <= std::numeric_limits<float>::max())) {
        skips_.add(GaussianDefect::not_finite, [&] {
          return fmt::format(
              "Gaussian {}, position {} ({}, texel {}): its logarithm is {:.4g}: at most 88.7 is expected", k, i,
              printable(meta_.means_low), k, l);
        });
        return false;
      }
      g.means.push_back(static_cast<float>(x));
    }
    return true;
  }

  bool add_scale(std::size_t k, const std::uint8_t* texel, Gaussians& g) {
    for (std::size_t i = 0; i < 3; ++i) {
      const float l = meta_.scales[i][texel[i]];
      const double scale = std::exp(static_cast<double>(l));
      if (!(scale <= std::numeric_limits<float>::max())) {
        const bool huge = scale > 0;
        skips_.add(huge ? GaussianDefect::huge_scale : GaussianDefect::not_finite, [&] {
          return fmt::format(
              "Gaussian {}, scale {} ({}, texel {}, byte {}): {}", k, i, printable(meta_.scales_file), k, texel[i],
              huge ? fmt::format("{}, its logarithm: at most 88.7 is expected", l) : "the codebook has no such entry");
        });
        return false;
      }
      g.scales.push_back(static_cast<float>(scale));
    }
    return true;
  }

  bool add_sh(std::size_t k, const std::uint8_t* texel, Gaussians& g) {
    for (std::size_t c = 0; c < 3; ++c)
      if (!add_coefficient(k, meta_.colours[c][texel[c]], meta_.sh0_file, texel[c], g)) return false;
    for (std::size_t j = 0; j < palette_.coefficients; ++j) {
      const std::uint8_t* centroid = palette_.at(k, j);
      for (std::size_t c = 0; c < 3; ++c) {
        if (!centroid)
          g.sh.push_back(0);
        else if (!add_coefficient(k, meta_.sh[centroid[c]], meta_.centroids_file, centroid[c], g))
          return false;
      }
    }
    return true;
  }

  bool add_coefficient(std::size_t k, float value, const std::string& file, int byte, Gaussians& g) {
    if (std::isfinite(value)) {
      g.sh.push_back(value);
      return true;
    }
    skips_.add(GaussianDefect::not_finite, [&] {
      return fmt::format("Gaussian {}, spherical harmonics ({}, byte {}): the codebook has no such entry", k,
                         printable(file), byte);
    });
    return false;
  }

  static void add_rotation(const std::uint8_t* texel, Gaussians& g) {
    double q[4] = {1, 0, 0, 0};
    if (texel[3] >= 252) {
      const std::size_t largest = texel[3] - 252u;
      double left = 1;
      for (std::size_t i = 0, from = 0; i < 4; ++i) {
        if (i == largest) continue;
        q[i] = (texel[from++] / 255.0 * 2 - 1) / std::sqrt(2.0);
        left -= q[i] * q[i];
      }
      q[largest] = std::sqrt(std::max(0.0, left));
    }
    const double norm = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (const double v : q) g.quats.push_back(static_cast<float>(v / norm));
  }

  std::string name_;
  const SogFiles& files_;
  GaussianSkips skips_;
  SogMeta meta_;
  Palette palette_;
};

}  // namespace

Scene read_sog(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped) {
  const MemoryZip archive(name, content);
  const SogFiles files = [&](const std::string& file) { return archive.read(file); };
  return SogReader(name, files, content.size(), skipped).read();
}

Scene read_sog_folder(const std::string& meta_path, SkippedGaussians* skipped) {
  const std::filesystem::path meta(meta_path);
  const SogFiles files = [&](const std::string& file) {
    return read_file(file == "meta.json" ? meta_path : (meta.parent_path() / file).string());
  };
  return SogReader(meta_path, files, 0, skipped).read();
}

}  // namespace vsplat
