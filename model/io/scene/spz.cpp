#include "model/io/scene/spz.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstring>

#include "model/io/scene/spz_container.h"
#include "model/io/scene/spz_values.h"
#include "runtime/half.h"
#include "runtime/message_text.h"

namespace vsplat {
namespace {

// Converts the three parts of a position.
void read_position(const SpzContainer& spz, std::size_t k, double step, float* out) {
  const std::vector<std::uint8_t>& from = spz.streams[kSpzPositions];
  for (std::size_t c = 0; c < 3; ++c) {
    if (spz.version == 1) {
      const std::uint8_t* at = &from[6 * k + 2 * c];
      out[c] = from_half(static_cast<std::uint16_t>(at[0] | at[1] << 8));
      continue;
    }
    const std::uint8_t* at = &from[9 * k + 3 * c];
    // The highest byte has the sign.
    const std::int32_t fixed = at[0] + (at[1] << 8) + static_cast<std::int8_t>(at[2]) * 65536;
    out[c] = static_cast<float>(fixed * step);
  }
}

// The bytes are x, y and z; w is at least 0.
std::array<double, 4> first_three(const std::uint8_t* at) {
  std::array<double, 4> out{};
  double rest = 1;
  for (std::size_t i = 0; i < 3; ++i) {
    out[i + 1] = at[i] / 127.5 - 1;
    rest -= out[i + 1] * out[i + 1];
  }
  out[0] = std::sqrt(std::max(0.0, rest));
  return out;
}

// Two bits name the largest of x y z w, which is at least 0; the others follow, the last one in the lowest bits.
std::array<double, 4> smallest_three(const std::uint8_t* at) {
  std::uint32_t packed = 0;
  std::memcpy(&packed, at, sizeof packed);
  const std::size_t largest = packed >> 30;
  std::array<double, 4> xyzw{};
  double rest = 1;
  for (std::size_t i = 4; i-- > 0;) {
    if (i == largest) continue;
    const double size = (packed & 511) / (std::sqrt(2.0) * kSpzRotationSteps);
    xyzw[i] = packed & 512 ? -size : size;
    rest -= size * size;
    packed >>= 10;
  }
  xyzw[largest] = std::sqrt(std::max(0.0, rest));
  return {xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
}

void read_rotation(const SpzContainer& spz, std::size_t k, const SpzFlips& flips, float* out) {
  const std::uint8_t* at = &spz.streams[kSpzRotations][spz.bytes_of(kSpzRotations) * k];
  const std::array<double, 4> q = spz.version < 3 ? first_three(at) : smallest_three(at);
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (std::size_t i = 0; i < 4; ++i)
    out[i] = flips.rotation[static_cast<Eigen::Index>(i)] * static_cast<float>(q[i] / length);
}

}  // namespace

SpzFlips spz_flips(std::uint32_t frame, int degree) {
  // The frames are numbered in binary: right, up and front are set bits of the number less one.
  const std::uint32_t axes = frame - 1;
  const float x = axes & 1 ? 1.0f : -1.0f;  // a PLY's x is right
  const float y = axes & 2 ? -1.0f : 1.0f;  // its y down
  const float z = axes & 4 ? 1.0f : -1.0f;  // its z front
  SpzFlips out{{x, y, z}, {1, y * z, x * z, x * y}, {}};
  // How each basis function changes with the signs of its argument's parts. The last is even in all of them, but the
  // format's own library changes its coefficient with y, and so do the files that exist.
  const std::vector<float> all = {y,     z,         x,                                     // degree 1
                                  x * y, y * z,     1,     x * z, 1,                       // 2
                                  y,     x * y * z, y,     z,     x, z,     x,             // 3
                                  x * y, y * z,     x * y, y * z, 1, x * z, 1, x * z, y};  // 4
  out.sh.assign(all.begin(), all.begin() + ((degree + 1) * (degree + 1) - 1));
  return out;
}

bool is_spz(std::span<const std::byte> beginning) {
  if (beginning.size() >= 4 && std::memcmp(beginning.data(), "NGSP", 4) == 0) return true;
  return beginning.size() >= 2 && std::memcmp(beginning.data(), "\x1f\x8b", 2) == 0;
}

Scene read_spz(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped) {
  const SpzContainer spz = unpack_spz(name, content);
  const SpzFlips flips = spz_flips(spz.frame, spz.degree);
  const std::size_t count = spz.count, rest = spz.coefficients();
  Scene scene;
  scene.antialias = spz.antialias;
  Gaussians& g = scene.gaussians;
  g.sh_degree = spz.degree;
  g.means.reserve(3 * count);
  g.scales.reserve(3 * count);
  g.quats.reserve(4 * count);
  g.opacities.reserve(count);
  g.sh.reserve(3 * count * (rest + 1));
  std::array<float, 256> scale_of{};
  for (std::size_t i = 0; i < 256; ++i)
    scale_of[i] = static_cast<float>(std::exp(static_cast<double>(i) / kSpzLogScaleSteps + kSpzLeastLogScale));
  const double step = std::ldexp(1.0, -spz.bits);
  GaussianSkips skips(name, skipped);
  for (std::size_t k = 0; k < count; ++k) {
    float mean[3];
    read_position(spz, k, step, mean);
    bool good = true;
    for (std::size_t c = 0; c < 3 && good; ++c)
      if (!std::isfinite(mean[c])) {
        good = false;
        skips.add(GaussianDefect::not_finite, [&] {
          return fmt::format(
              "Gaussian {}, position {} (byte {} of the decompressed data): {}, a finite number is expected", k, c,
              16 + 6 * k + 2 * c, number_text(mean[c]));
        });
      }
    if (!good) continue;
    for (std::size_t c = 0; c < 3; ++c) g.means.push_back(flips.position[static_cast<Eigen::Index>(c)] * mean[c]);
    for (std::size_t c = 0; c < 3; ++c) g.scales.push_back(scale_of[spz.streams[kSpzScales][3 * k + c]]);
    float q[4];
    read_rotation(spz, k, flips, q);
    g.quats.insert(g.quats.end(), q, q + 4);
    g.opacities.push_back(static_cast<float>(spz.streams[kSpzAlphas][k] / 255.0));
    for (std::size_t c = 0; c < 3; ++c)
      g.sh.push_back(static_cast<float>((spz.streams[kSpzColors][3 * k + c] / 255.0 - 0.5) / kSpzColorScale));
    const std::uint8_t* sh = spz.streams[kSpzSh].data() + 3 * rest * k;
    for (std::size_t i = 0; i < rest; ++i)
      for (std::size_t c = 0; c < 3; ++c)
        g.sh.push_back(flips.sh[i] * static_cast<float>((sh[3 * i + c] - kSpzShSteps) / kSpzShSteps));
    ++g.count;
  }
  skips.report(count);
  return scene;
}

}  // namespace vsplat
