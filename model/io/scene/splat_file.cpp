#include "model/io/scene/splat_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "runtime/fail.h"
#include "runtime/message_text.h"

namespace vsplat {
namespace {

struct SplatRow {
  explicit SplatRow(const std::byte* at) {
    std::memcpy(values.data(), at, splat::kColour);
    std::memcpy(colour.data(), at + splat::kColour, colour.size());
    std::memcpy(rotation.data(), at + splat::kRotation, rotation.size());
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
  if (beginning.size() < splat::kRow) return false;
  for (std::size_t at = 0; at + splat::kRow <= beginning.size(); at += splat::kRow) {
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
  if (content.size() % splat::kRow != 0)
    fail(Status::format,
         "{}: {} bytes: a .splat file has {} for each Gaussian: it is cut off after {} of them, or no such file", name,
         content.size(), splat::kRow, content.size() / splat::kRow);
  const std::size_t count = content.size() / splat::kRow;
  Scene scene;
  Gaussians& g = scene.gaussians;
  g.means.reserve(3 * count);
  g.scales.reserve(3 * count);
  g.quats.reserve(4 * count);
  g.opacities.reserve(count);
  g.sh.reserve(3 * count);
  GaussianSkips skips(name, skipped);
  for (std::size_t k = 0; k < count; ++k) {
    const SplatRow row(&content[k * splat::kRow]);
    if (const std::size_t bad = row.bad_value(); bad != row.values.size()) {
      skips.add(GaussianDefect::not_finite, [&] {
        return fmt::format("Gaussian {}, {} {} (byte {}): {}, a finite number{} is expected", k,
                           bad < 3 ? "position" : "scale", bad % 3, k * splat::kRow + 4 * bad,
                           number_text(row.values[bad]), bad < 3 ? "" : " from 0 up");
      });
      continue;
    }
    const double length = row.length();
    if (!(length > 0)) {
      skips.add(GaussianDefect::zero_rotation, [&] {
        return fmt::format("Gaussian {}, rotation (byte {}): the quaternion is zero, any other length is expected", k,
                           k * splat::kRow + splat::kRotation);
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

}  // namespace vsplat
