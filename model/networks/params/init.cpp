#include "model/networks/params/init.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "model/base/normal_quantile.h"
#include "model/base/rng.h"
#include "model/networks/params/params.h"

namespace vsplat {
namespace {

// Fills out[i] with make(u), where u in (0,1) is word i % 4 of the block with the counter {i / 4 (two words), stream,
// 0}.
template <class Make>
void draw(std::vector<float>& out, std::uint64_t seed, std::uint32_t stream, Make make) {
  const auto key = rng_key(seed);
  for (std::size_t i = 0; i < out.size(); i += 4) {
    const std::uint64_t block = i / 4;
    const auto words =
        philox4x32_10({static_cast<std::uint32_t>(block), static_cast<std::uint32_t>(block >> 32), stream, 0}, key);
    for (std::size_t k = 0; k < 4 && i + k < out.size(); ++k)
      out[i + k] = static_cast<float>(make((words[k] + 0.5) * 0x1p-32));
  }
}

void draw_uniform(std::vector<float>& out, std::uint64_t seed, std::uint32_t stream, double bound) {
  draw(out, seed, stream, [bound](double u) { return bound * (2 * u - 1); });
}

void draw_normal(std::vector<float>& out, std::uint64_t seed, std::uint32_t stream, double deviation) {
  draw(out, seed, stream, [deviation](double u) { return deviation * normal_quantile(u); });
}

// Offsets within a quarter of a voxel on either side of its centre.
std::vector<float> fine_places(const Config& config) {
  const double reach = 1.0 / config.volume / 4;
  std::vector<float> out;
  for (const double p : sobol_points(config.fine_count)) out.push_back(static_cast<float>((2 * p - 1) * reach));
  return out;
}

HostTensor initial_tensor(const Parameter& p, std::uint64_t seed) {
  HostTensor out{p.shape, {}};
  out.data.resize(static_cast<std::size_t>(p.count()), p.init == Init::ones ? 1.0f : 0.0f);
  const std::uint32_t stream = stream_of(p.name);
  const auto fan_in = static_cast<double>(p.fan_in);
  switch (p.init) {
    case Init::fan_in:
      draw_uniform(out.data, seed, stream, 1 / std::sqrt(fan_in));
      break;
    case Init::xavier:
      draw_uniform(out.data, seed, stream, std::sqrt(6 / (fan_in + static_cast<double>(p.fan_out))));
      break;
    case Init::submanifold:
    case Init::normal:
      draw_normal(out.data, seed, stream, 1 / std::sqrt(fan_in));
      break;
    case Init::position:
      draw_normal(out.data, seed, stream, 0.02);
      break;
    case Init::layer_scale:
      std::fill(out.data.begin(), out.data.end(), 1e-5f);
      break;
    case Init::zeros:
    case Init::ones:
    case Init::sobol:
      break;
  }
  return out;
}

}  // namespace

std::vector<double> sobol_points(int count) {
  // Direction numbers of Joe and Kuo: van der Corput's; of x + 1 with m = 1; of x^2 + x + 1 with m = 1, 3. With v = m /
  // 2^j: v_j = (a_1 v_{j-1}) ^ ... ^ v_{j-s} ^ (v_{j-s} / 2^s).
  std::array<std::uint32_t, 32> a{}, b{}, c{};
  for (int j = 0; j < 32; ++j) {
    a[j] = 1u << (31 - j);
    b[j] = j == 0 ? 1u << 31 : b[j - 1] ^ b[j - 1] >> 1;
    c[j] = j == 0 ? 1u << 31 : j == 1 ? 3u << 30 : c[j - 1] ^ c[j - 2] ^ c[j - 2] >> 2;
  }
  std::array<std::uint32_t, 3> x{};
  std::vector<double> out;
  for (int i = 0; i < count; ++i)
    for (int axis = 0; axis < 3; ++axis) {
      x[axis] ^= (axis == 0 ? a : axis == 1 ? b : c)[std::countr_one(static_cast<unsigned>(i))];
      out.push_back(x[axis] * 0x1p-32);
    }
  return out;
}

Weights initial_weights(const AnyConfig& config, std::uint64_t seed) {
  check(config);
  Weights weights;
  for (const Parameter& p : parameters(config)) {
    const Config* own = p.init == Init::sobol ? config.as<Config>() : nullptr;
    weights.set(p.name, own ? HostTensor{p.shape, fine_places(*own)} : initial_tensor(p, seed));
  }
  return weights;
}

std::size_t scale_places(Weights& weights, const Config& config, double factor) {
  std::size_t count = 0;
  for (const Parameter& p : parameters(config)) {
    if (p.init != Init::sobol) continue;
    HostTensor scaled = weights.of(p);
    for (float& v : scaled.data) v = static_cast<float>(static_cast<double>(v) * factor);
    count += scaled.data.size();
    weights.set(p.name, std::move(scaled));
  }
  return count;
}

}  // namespace vsplat
