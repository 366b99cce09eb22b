#include "model/params/init.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cmath>
#include <set>
#include <string_view>

#include "model/base/normal_quantile.h"
#include "model/base/rng.h"
#include "model/params/params.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/printable.h"
#include "runtime/safetensors.h"

namespace vsplat {
namespace {

// Element i takes word i % 4 of the block whose counter is {i / 4 (two words), stream, 0}, as a number in (0,1) ->
// make(u).
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

HostTensor initial_tensor(const Parameter& p, const Config& config, std::uint64_t seed) {
  HostTensor out{p.shape, {}};
  if (p.init == Init::sobol) {
    out.data = fine_places(config);
    return out;
  }
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
      draw_normal(out.data, seed, stream, 1 / std::sqrt(fan_in));
      break;
    case Init::position:
      draw_normal(out.data, seed, stream, 0.02);
      break;
    case Init::zeros:
    case Init::ones:
    case Init::sobol:
      break;
  }
  return out;
}

// ---------------------------------------------------------------------------------------------------------- an encoder

constexpr std::string_view kEncoder = "encoder.model.";

std::string encoder_prefix(const SafetensorsFile& file) {
  for (const char* prefix : {"", "model.", "encoder.model.", "net.encoder.model.", "backbone.", "module."})
    if (file.find(std::string(prefix) + "cls_token") != nullptr) return prefix;
  fail(Status::format,
       "{}: no cls_token, with or without the prefixes model., encoder.model., net.encoder.model., backbone., module.: "
       "not "
       "a ViT in timm's naming",
       file.path());
}

bool is_head(std::string_view name) { return name.starts_with("head.") || name.starts_with("fc_norm."); }

// The configuration's fields as the file's tensors show them; each that differs is named.
void compare_sizes(const SafetensorsFile& file, const std::string& prefix, const Config& config) {
  const auto need = [&](const char* field, long found, long expected) {
    if (found != expected)
      fail(Status::format,
           "{}: an encoder with {} = {}, but the configuration has {} (vsplat_model_options.fields {}={} makes it fit)",
           file.path(), field, found, expected, field, found);
  };
  const auto shape_of = [&](const char* name, std::size_t rank) {
    const TensorEntry& entry = file.at(prefix + name);
    if (entry.shape.size() != rank)
      fail(Status::format, "{}: tensor {} has shape {}, expected {} dimensions", file.path(), entry.name,
           printable(text_of(entry.shape)), rank);
    return entry.shape;
  };
  need("vit_dim", shape_of("cls_token", 3)[2], config.vit_dim);
  need("patch", shape_of("patch_embed.proj.weight", 4)[3], config.patch);
  const long positions = shape_of("pos_embed", 3)[1] - 1;
  const long grid = std::lround(std::sqrt(static_cast<double>(positions < 0 ? 0 : positions)));
  if (grid * grid != positions)
    fail(Status::format, "{}: tensor {}pos_embed holds {} positions, expected a square and the class token's",
         file.path(), prefix, positions + 1);
  need("vit_pos_grid", grid, config.vit_pos_grid);
  long depth = 0;
  while (file.find(fmt::format("{}blocks.{}.norm1.weight", prefix, depth)) != nullptr) ++depth;
  need("vit_depth", depth, config.vit_depth);
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

Weights initial_weights(const Config& config, std::uint64_t seed) {
  check(config);
  Weights weights;
  for (const Parameter& p : parameters(config)) weights.set(p.name, initial_tensor(p, config, seed));
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

void load_encoder(Weights& weights, const Config& config, const std::string& path) {
  const SafetensorsFile file(path);
  if (file.check_hash() == HashState::differs)
    fail(Status::format, "{}: its content does not match its sha256: the file is damaged", path);
  const std::string prefix = encoder_prefix(file);
  compare_sizes(file, prefix, config);
  std::map<std::string, const TensorEntry*> found;
  for (const Parameter& p : parameters(config)) {
    if (!p.name.starts_with(kEncoder)) continue;
    const TensorEntry& entry = file.at(prefix + p.name.substr(kEncoder.size()));
    if (entry.shape != p.shape)
      fail(Status::format, "{}: tensor {} has shape {}, expected {} for this configuration", path, entry.name,
           printable(text_of(entry.shape)), text_of(p.shape));
    if (entry.dtype != Dtype::f32 && entry.dtype != Dtype::f16 && entry.dtype != Dtype::bf16)
      fail(Status::format, "{}: tensor {} is {}, expected F32, F16 or BF16", path, entry.name, name_of(entry.dtype));
    found[p.name] = &entry;
  }
  std::size_t ignored = 0;
  for (const TensorEntry& entry : file.tensors()) {
    const bool inside = entry.name.starts_with(prefix);
    const std::string name = inside ? entry.name.substr(prefix.size()) : entry.name;
    if (inside && found.count(std::string(kEncoder) + name) != 0) continue;
    if (inside && !is_head(name))
      fail(Status::format, "{}: tensor {}: the encoder is a plain ViT and has none of that name", path,
           printable(entry.name));
    ++ignored;
  }
  if (ignored != 0) info("{}: {} tensors that do not belong to the encoder are left alone", path, ignored);
  for (const auto& [name, entry] : found) weights.set(name, {entry->shape, file.floats(*entry)});
}

}  // namespace vsplat
