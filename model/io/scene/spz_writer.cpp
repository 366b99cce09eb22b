#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <future>

#include "model/io/scene/spz.h"
#include "model/io/scene/spz_container.h"
#include "model/io/scene/spz_values.h"
#include "model/io/scene/written_gaussians.h"
#include "runtime/fail.h"
#include "runtime/files/output_file.h"

namespace vsplat {
namespace {

constexpr int kWrittenBits = 22;
constexpr double kFixedRange = 1 << 23;
// Coefficients are rounded to multiples of this many steps, for smaller files.
constexpr double kShBucket = 4;

double farthest(const Gaussians& g) {
  float most = 0;
  for (const float v : g.means) most = std::max(most, std::abs(v));
  return most;
}

// As many fractional bits as the farthest position leaves.
int bits_for(double most) {
  int bits = kWrittenBits;
  while (bits > 0 && std::ldexp(most, bits) > kFixedRange - 1) --bits;
  return bits;
}

void put_position(const float* mean, const SpzFlips& flips, int bits, std::uint8_t* out) {
  for (Eigen::Index c = 0; c < 3; ++c) {
    const double steps = static_cast<double>(flips.position[c] * mean[c]) * (1 << bits);
    const auto fixed = static_cast<std::int32_t>(std::lround(steps));
    for (int byte = 0; byte < 3; ++byte) *out++ = static_cast<std::uint8_t>(fixed >> (8 * byte) & 255);
  }
}

void put_rotation(const float* quat, const SpzFlips& flips, int version, std::uint8_t* out) {
  const UnitQuaternion unit(quat);
  double xyzw[4];
  for (Eigen::Index i = 0; i < 4; ++i)
    xyzw[i] = unit.at[(i + 1) % 4] * static_cast<double>(flips.rotation[(i + 1) % 4]);
  if (version < 3) {
    const double sign = xyzw[3] < 0 ? -127.5 : 127.5;
    for (int i = 0; i < 3; ++i) out[i] = to_byte(sign * xyzw[i] + 127.5);
    return;
  }
  std::uint32_t largest = 0;
  for (std::uint32_t i = 1; i < 4; ++i)
    if (std::abs(xyzw[i]) > std::abs(xyzw[largest])) largest = i;
  std::uint32_t packed = largest;
  for (std::uint32_t i = 0; i < 4; ++i) {
    if (i == largest) continue;
    const auto size = static_cast<std::uint32_t>(std::lround(std::abs(xyzw[i]) * std::sqrt(2.0) * kSpzRotationSteps));
    const bool negative = (xyzw[i] < 0) != (xyzw[largest] < 0);
    packed = packed << 10 | (negative ? 512u : 0u) | std::min<std::uint32_t>(size, kSpzRotationSteps);
  }
  for (int byte = 0; byte < 4; ++byte) out[byte] = static_cast<std::uint8_t>(packed >> (8 * byte) & 255);
}

std::uint8_t sh_byte(float value) {
  const double bucket = std::clamp(value * kSpzShSteps + kSpzShSteps, 0.0, 255.0) / kShBucket;
  return to_byte(kShBucket * static_cast<int>(bucket + 0.5));  // NOLINT(bugprone-incorrect-roundings): as to_byte()
}

// Packs the Gaussians from `begin` up to `end`.
void pack_range(const Gaussians& g, std::size_t begin, std::size_t end, const SpzFlips& flips, SpzContainer& out) {
  const std::size_t rest = out.coefficients(), rotation = out.bytes_of(kSpzRotations);
  for (std::size_t k = begin; k < end; ++k) {
    put_position(&g.means[3 * k], flips, out.bits, &out.streams[kSpzPositions][9 * k]);
    out.streams[kSpzAlphas][k] = to_byte(g.opacities[k] * 255.0);
    const float* sh = &g.sh[3 * k * g.sh_count()];
    for (std::size_t c = 0; c < 3; ++c) {
      out.streams[kSpzColors][3 * k + c] = to_byte((static_cast<double>(sh[c]) * kSpzColorScale + 0.5) * 255);
      const double s = g.scales[3 * k + c];
      out.streams[kSpzScales][3 * k + c] = to_byte((std::log(s) - kSpzLeastLogScale) * kSpzLogScaleSteps);
    }
    put_rotation(&g.quats[4 * k], flips, out.version, &out.streams[kSpzRotations][rotation * k]);
    std::uint8_t* to = out.streams[kSpzSh].data() + 3 * rest * k;
    for (std::size_t i = 0; i < rest; ++i)
      for (std::size_t c = 0; c < 3; ++c) to[3 * i + c] = sh_byte(flips.sh[i] * sh[3 * (i + 1) + c]);
  }
}

SpzContainer packed(const Gaussians& g, int version, int bits) {
  SpzContainer out;
  out.version = version;
  out.count = static_cast<std::uint32_t>(g.count);
  out.degree = g.sh_degree;
  out.bits = bits;
  const SpzFlips flips = spz_flips(out.frame, out.degree);
  for (std::size_t s = 0; s < kSpzStreams; ++s) out.streams[s].resize(g.count * out.bytes_of(s));
  // Each half has bytes of its own.
  auto half = std::async(std::launch::async, [&] { pack_range(g, 0, g.count / 2, flips, out); });
  pack_range(g, g.count / 2, g.count, flips, out);
  half.get();
  return out;
}

}  // namespace

void write_spz(const std::string& path, const Scene& scene, int version) {
  if (version < 2 || version > kSpzNewest)
    fail(Status::usage, "{}: SPZ version {}: 2 to {} are written", path, version, kSpzNewest);
  Gaussians made;
  const Gaussians& g = volumes_to_write(path, scene.gaussians, made);
  if (g.count > INT32_MAX) fail(Status::input, "{}: {} Gaussians: SPZ holds {}", path, g.count, INT32_MAX);
  const double most = farthest(g);
  if (most > kFixedRange - 1)
    fail(Status::input,
         "{}: a position has {} in it: SPZ holds numbers below {}; move or scale the scene, or remove what is that far "
         "away",
         path, most, kFixedRange);
  OutputFile file(path);
  SpzContainer spz = packed(g, version, bits_for(most));
  spz.antialias = scene.antialias;
  file.write(pack_spz(spz));
  file.commit();
}

std::vector<std::string> spz_rounding(const Scene& scene) {
  const Gaussians& g = scene.gaussians;
  std::size_t scales = 0, colours = 0, coefficients = 0;
  for (const float s : g.scales) {
    const double step = (std::log(static_cast<double>(s)) - kSpzLeastLogScale) * kSpzLogScaleSteps;
    scales += step < -0.5 || step > 255.5;
  }
  for (std::size_t i = 0; i < g.sh.size(); ++i) {
    const double v = g.sh[i];
    if (i / 3 % g.sh_count() == 0)
      colours += std::abs(v) * kSpzColorScale > 0.5;
    else
      coefficients += std::abs(v) > 1;
  }
  std::vector<std::string> out = {
      fmt::format("positions are rounded to {:.3g}", std::ldexp(1.0, -bits_for(farthest(g)))),
      "scales are rounded to 1/16 of their logarithm",
      "rotations are rounded to 1/723 in three parts of the quaternion, in version 2 to 1/127",
      "opacities are rounded to 1/255, and colours to 1/38 of their coefficient"};
  if (g.sh_degree > 0)
    out.push_back(fmt::format("spherical harmonics above degree 0 are rounded to {:.3g}", kShBucket / kSpzShSteps));
  const auto beyond = [&](std::size_t count, const char* what) {
    if (count) out.push_back(fmt::format("{} {}", count, what));
  };
  beyond(scales, "scales outside 4.5e-5 to 380 are clamped to it");
  beyond(colours, "colour coefficients outside -3.3 to 3.3 are clamped to it");
  beyond(coefficients, "coefficients outside -1 to 1 are clamped to it");
  return out;
}

}  // namespace vsplat
