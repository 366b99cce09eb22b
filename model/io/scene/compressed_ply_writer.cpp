#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "model/io/scene/compressed_ply.h"
#include "model/io/scene/morton_order.h"
#include "model/io/scene/ply_comments.h"
#include "model/io/scene/written_gaussians.h"
#include "runtime/files/output_file.h"

namespace vsplat {
namespace {

using namespace compressed_ply;

constexpr int kWrittenDegree = 3;
constexpr double kMostLogScale = 20;

// The Gaussians along a Morton curve through the scene's box.
std::vector<std::uint32_t> curve_order(const Gaussians& g) {
  std::vector<std::array<std::uint16_t, 3>> places(g.count);
  for (std::size_t c = 0; c < 3; ++c) {
    float low = g.means[c], high = low;
    for (std::size_t k = 0; k < g.count; ++k) {
      low = std::min(low, g.means[3 * k + c]);
      high = std::max(high, g.means[3 * k + c]);
    }
    const double range = static_cast<double>(high) - low;
    for (std::size_t k = 0; k < g.count; ++k) {
      const double share = range > 0 ? (static_cast<double>(g.means[3 * k + c]) - low) / range : 0;
      places[k][c] = static_cast<std::uint16_t>(std::lround(share * 1023));
    }
  }
  return morton_order(places);
}

// The nine values of a Gaussian that have bounds, as a block stores them.
struct Bounded {
  std::array<float, 9> values{};  // position, logarithm of the scale, colour

  Bounded(const Gaussians& g, std::size_t k) {
    for (std::size_t c = 0; c < 3; ++c) {
      values[c] = g.means[3 * k + c];
      const double log = std::log(static_cast<double>(g.scales[3 * k + c]));
      values[3 + c] = static_cast<float>(std::clamp(log, -kMostLogScale, kMostLogScale));
      values[6 + c] = static_cast<float>(0.5 + kShC0 * static_cast<double>(g.sh[3 * k * g.sh_count() + c]));
    }
  }
};

struct BlockBounds {
  std::array<float, 9> low{}, high{};

  // The nearest integer for the share of the way from low to high.
  std::uint32_t packed(const Bounded& from, std::size_t i, int bits) const {
    const double range = static_cast<double>(high[i]) - low[i];
    const double share = range > 0 ? (static_cast<double>(from.values[i]) - low[i]) / range : 0;
    return static_cast<std::uint32_t>(std::lround(std::clamp(share, 0.0, 1.0) * ((1 << bits) - 1)));
  }
  std::uint32_t packed_11_10_11(const Bounded& from, std::size_t first) const {
    return packed(from, first, 11) << 21 | packed(from, first + 1, 10) << 11 | packed(from, first + 2, 11);
  }
  // In the order of kBounds.
  std::array<float, kNumBounds> properties() const {
    std::array<float, kNumBounds> out{};
    for (std::size_t group = 0; group < 3; ++group)
      for (std::size_t c = 0; c < 3; ++c) {
        out[6 * group + c] = low[3 * group + c];
        out[6 * group + 3 + c] = high[3 * group + c];
      }
    return out;
  }
};

std::vector<BlockBounds> bounds_of(const Gaussians& g, const std::vector<std::uint32_t>& order) {
  std::vector<BlockBounds> out((g.count + kBlockSize - 1) / kBlockSize);
  for (std::size_t i = 0; i < g.count; ++i) {
    const Bounded own(g, order[i]);
    BlockBounds& block = out[i / kBlockSize];
    for (std::size_t v = 0; v < own.values.size(); ++v) {
      block.low[v] = i % kBlockSize ? std::min(block.low[v], own.values[v]) : own.values[v];
      block.high[v] = i % kBlockSize ? std::max(block.high[v], own.values[v]) : own.values[v];
    }
  }
  return out;
}

std::uint32_t packed_rotation(const float* quat) {
  const UnitQuaternion q(quat);
  std::uint32_t largest = 0;
  for (std::uint32_t i = 1; i < 4; ++i)
    if (std::abs(q.at[i]) > std::abs(q.at[largest])) largest = i;
  const double sign = q.at[largest] < 0 ? -1 : 1;
  std::uint32_t out = largest;
  for (std::uint32_t i = 0; i < 4; ++i) {
    if (i == largest) continue;
    const double share = sign * q.at[i] * std::sqrt(0.5) + 0.5;
    out = out << 10 | static_cast<std::uint32_t>(std::lround(std::clamp(share, 0.0, 1.0) * 1023));
  }
  return out;
}

std::array<std::uint32_t, 4> packed(const Gaussians& g, std::size_t k, const BlockBounds& block) {
  const Bounded own(g, k);
  return {block.packed_11_10_11(own, 0), packed_rotation(&g.quats[4 * k]), block.packed_11_10_11(own, 3),
          block.packed(own, 6, 8) << 24 | block.packed(own, 7, 8) << 16 | block.packed(own, 8, 8) << 8 |
              to_byte(g.opacities[k] * 255.0)};
}

// A byte for each coefficient of -4 to 4, channel by channel.
void put_sh(const Gaussians& g, std::size_t k, std::size_t rest, std::vector<std::uint8_t>& out) {
  const float* sh = &g.sh[3 * k * g.sh_count()];
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t i = 1; i <= rest; ++i)
      out.push_back(to_byte(std::floor((static_cast<double>(sh[3 * i + c]) / 8 + 0.5) * 256)));
}

std::string header_of(const Scene& scene, std::size_t count, std::size_t blocks, std::size_t rest) {
  std::string out = "ply\nformat binary_little_endian 1.0\n" + comments_of(scene);
  out += fmt::format("element chunk {}\n", blocks);
  for (const char* name : kBounds) out += fmt::format("property float {}\n", name);
  out += fmt::format("element vertex {}\n", count);
  for (const char* name : kPacked) out += fmt::format("property uint {}\n", name);
  if (rest) out += fmt::format("element sh {}\n", count);
  for (std::size_t i = 0; i < 3 * rest; ++i) out += fmt::format("property uchar f_rest_{}\n", i);
  return out + "end_header\n";
}

}  // namespace

void write_compressed_ply(const std::string& path, const Scene& scene) {
  Gaussians made;
  const Gaussians& g = volumes_to_write(path, scene.gaussians, made);
  const std::size_t degree = static_cast<std::size_t>(std::min(g.sh_degree, kWrittenDegree));
  const std::size_t rest = (degree + 1) * (degree + 1) - 1;
  const std::vector<std::uint32_t> order = curve_order(g);
  const std::vector<BlockBounds> blocks = bounds_of(g, order);
  OutputFile file(path);
  file.write(header_of(scene, g.count, blocks.size(), rest));
  for (const BlockBounds& block : blocks) {
    const std::array<float, kNumBounds> values = block.properties();
    file.write(values.data(), sizeof values);
  }
  for (std::size_t i = 0; i < g.count; ++i) {
    const std::array<std::uint32_t, 4> values = packed(g, order[i], blocks[i / kBlockSize]);
    file.write(values.data(), sizeof values);
  }
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; rest && i < g.count; ++i) {
    bytes.clear();
    put_sh(g, order[i], rest, bytes);
    file.write(bytes.data(), bytes.size());
  }
  file.commit();
}

std::vector<std::string> compressed_ply_rounding(const Scene& scene) {
  const Gaussians& g = scene.gaussians;
  std::vector<std::string> out = {"positions and scales are rounded to 1/1023 of the range in blocks of 256 Gaussians",
                                  "rotations are rounded to 1/723 in three parts of the quaternion",
                                  "colours and opacities are rounded to 1/255", "Gaussians are sorted by place"};
  if (g.sh_degree > 0) out.emplace_back("spherical harmonics above degree 0 are rounded to 1/32");
  std::size_t beyond = 0;
  for (std::size_t i = 0; i < g.sh.size(); ++i) beyond += i / 3 % g.sh_count() != 0 && std::abs(g.sh[i]) > 4;
  if (beyond) out.push_back(fmt::format("{} coefficients outside -4 to 4 are clamped to it", beyond));
  return out;
}

}  // namespace vsplat
