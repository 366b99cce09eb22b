#include "model/params/load_encoder.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <string_view>

#include "model/io/torch_file.h"
#include "model/params/match_tensors.h"
#include "model/params/params.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/printable.h"
#include "runtime/safetensors.h"

namespace vsplat {
namespace {

constexpr std::string_view kEncoder = "encoder.model.";

template <class File>
std::string encoder_prefix(const File& file) {
  for (const char* prefix :
       {"", "model.", "encoder.model.", "net.encoder.model.", "backbone.", "module.", "module.backbone."})
    if (file.find(std::string(prefix) + "cls_token") != nullptr) return prefix;
  fail(Status::format,
       "{}: no cls_token, with or without the prefixes model., encoder.model., net.encoder.model., backbone., module., "
       "module.backbone.: not a ViT in timm's naming",
       file.path());
}

bool is_head(std::string_view name) { return name.starts_with("head.") || name.starts_with("fc_norm."); }

// The configuration's fields as the file's tensors show them; each that differs is named.
template <class File>
void compare_sizes(const File& file, const std::string& prefix, const Config& config) {
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

template <class File>
void take_encoder(Weights& weights, const Config& config, const File& file) {
  const std::string& path = file.path();
  const std::string prefix = encoder_prefix(file);
  compare_sizes(file, prefix, config);
  std::map<std::string, const TensorEntry*> found;
  for (const Parameter& p : parameters(config)) {
    if (!p.name.starts_with(kEncoder)) continue;
    const TensorEntry& entry = file.at(prefix + p.name.substr(kEncoder.size()));
    require_weights(path, entry, p);
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

}  // namespace

void load_encoder(Weights& weights, const Config& config, const std::string& path) {
  if (TorchFile::looks_like(path)) return take_encoder(weights, config, TorchFile(path));
  const SafetensorsFile file(path);
  if (file.check_hash() == HashState::differs)
    fail(Status::format, "{}: its content does not match its sha256: the file is damaged", path);
  take_encoder(weights, config, file);
}

}  // namespace vsplat
