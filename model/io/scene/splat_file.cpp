#include "model/io/scene/splat_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numeric>

#include "model/io/scene/written_gaussians.h"
#include "runtime/fail.h"
#include "runtime/files/output_file.h"

namespace vsplat {
namespace {

constexpr std::size_t kSplatBytes = 32;
constexpr std::size_t kSplatColour = 24, kSplatRotation = 28;  // bytes from the beginning of a row

struct SplatRow {
  explicit SplatRow(const std::byte* at) {
    std::memcpy(values.data(), at, kSplatColour);
    std::memcpy(colour.data(), at + kSplatColour, colour.size());
    std::memcpy(rotation.data(), at + kSplatRotation, rotation.size());
  }

  std::array<float, 6> values{};  // position, scales
  std::array<std::uint8_t, 4> colour{}, rotation{};

  // w x y z, of any length
  std::array<double, 4> quaternion() const {
    std::array<double, 4> out{};
    for (std::size_t i = 0; i < 4; ++i) out[i] = (rotation[i] - 128.0) / 128;
    return out;
  }
  double length() const {
    const std::array<double, 4> q = quaternion();
    return std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  }
  // The first value that cannot be drawn, or 6.
  std::size_t bad_value() const {
    for (std::size_t i = 0; i < values.size(); ++i)
      if (!std::isfinite(values[i]) || (i >= 3 && values[i] < 0)) return i;
    return values.size();
  }
};

}  // namespace

bool is_splat(std::span<const std::byte> beginning) {
  if (beginning.size() < kSplatBytes) return false;
  for (std::size_t at = 0; at + kSplatBytes <= beginning.size(); at += kSplatBytes) {
    const SplatRow row(&beginning[at]);
    // Rounding changes the length by at most 0.02.
    if (row.bad_value() != row.values.size() || std::abs(row.length() - 1) > 0.05) return false;
    for (const float v : row.values)
      if (std::abs(v) > 1e9f) return false;
  }
  return true;
}

Scene read_splat(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped) {
  if (content.empty()) fail(Status::format, "{}: an empty file, where a .splat file of Gaussians is expected", name);
  if (content.size() % kSplatBytes != 0)
    fail(Status::format,
         "{}: {} bytes: a .splat file has {} for each Gaussian: it is cut off after {} of them, or no such file", name,
         content.size(), kSplatBytes, content.size() / kSplatBytes);
  const std::size_t count = content.size() / kSplatBytes;
  Scene scene;
  Gaussians& g = scene.gaussians;
  g.means.reserve(3 * count);
  g.scales.reserve(3 * count);
  g.quats.reserve(4 * count);
  g.opacities.reserve(count);
  g.sh.reserve(3 * count);
  GaussianSkips skips(name, skipped);
  for (std::size_t k = 0; k < count; ++k) {
    const SplatRow row(&content[k * kSplatBytes]);
    if (const std::size_t bad = row.bad_value(); bad != row.values.size()) {
      skips.add(GaussianDefect::not_finite, [&] {
        return fmt::format("Gaussian {}, {} {} (byte {}): {}, a finite number{} is expected", k,
                           bad < 3 ? "position" : "scale", bad % 3, k * kSplatBytes + 4 * bad, row.values[bad],
                           bad < 3 ? "" : " from 0 up");
      });
      continue;
    }
    const double length = row.length();
    if (!(length > 0)) {
      skips.add(GaussianDefect::zero_rotation, [&] {
        return fmt::format("Gaussian {}, rotation (byte {}): the quaternion is zero, any other length is expected", k,
                           k * kSplatBytes + kSplatRotation);
      });
      continue;
    }
    g.means.insert(g.means.end(), row.values.begin(), row.values.begin() + 3);
    g.scales.insert(g.scales.end(), row.values.begin() + 3, row.values.end());
    for (const double q : row.quaternion()) g.quats.push_back(static_cast<float>(q / length));
    g.opacities.push_back(static_cast<float>(row.colour[3] / 255.0));
    for (std::size_t c = 0; c < 3; ++c) g.sh.push_back(static_cast<float>((row.colour[c] / 255.0 - 0.5) / kShC0));
    ++g.count;
  }
  skips.report(count);
  return scene;
}

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
    rows.resize(at + kSplatBytes);
    std::uint8_t* row = &rows[at];
    std::memcpy(row, &g.means[3 * k], 12);
    std::memcpy(row + 12, &g.scales[3 * k], 12);
    const float* sh = &g.sh[3 * k * g.sh_count()];
    for (std::size_t c = 0; c < 3; ++c)
      row[kSplatColour + c] = to_byte((0.5 + kShC0 * static_cast<double>(sh[c])) * 255);
    row[kSplatColour + 3] = to_byte(g.opacities[k] * 255.0);
    const UnitQuaternion q(&g.quats[4 * k]);
    for (std::size_t c = 0; c < 4; ++c) row[kSplatRotation + c] = to_byte(q.at[c] * 128 + 128);
    if (rows.size() < kRowsAtOnce * kSplatBytes && i + 1 < g.count) continue;
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
      beyond += colour < 0 || colour > 1;
    }
  std::vector<std::string> out = {"colours and opacities are rounded to 1/255",
                                  "rotations are rounded to 1/128 in each part of the quaternion",
                                  "Gaussians are sorted by size and opacity"};
  if (beyond) out.push_back(fmt::format("{} colour values outside 0 to 1 are clamped to it", beyond));
  return out;
}

}  // namespace vsplat
