#include "model/networks/params/deduced_config.h"

#include <fmt/format.h>

#include <cmath>

#include "model/networks/params/network_layers.h"
#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

class Shapes {
 public:
  Shapes(const TorchFile& file, const std::string& prefix) : file_(file), prefix_(prefix) {}

  // The size of a tensor's dimension `axis`; the tensor must have `rank` dimensions.
  int side(const std::string& name, std::size_t rank, std::size_t axis) const {
    constexpr long kMost = 1 << 20;
    const TensorEntry& entry = file_.at(prefix_ + name);
    if (entry.shape.size() != rank || entry.shape[axis] < 1 || entry.shape[axis] > kMost)
      fail(Status::format, "{}: tensor {} has shape {}, {} sides from 1 to {} are expected", file_.path(),
           printable(entry.name), printable(text_of(entry.shape)), rank, kMost);
    return static_cast<int>(entry.shape[axis]);
  }
  // Number of consecutive tensors first.0.last, first.1.last, ...
  int count(const std::string& first, const std::string& last) const {
    int out = 0;
    while (file_.find(fmt::format("{}{}.{}.{}", prefix_, first, out, last)) != nullptr) ++out;
    return out;
  }
  [[noreturn]] void bad(const std::string& name, long found, const char* expected) const {
    fail(Status::format, "{}: tensor {}{} has {} rows, {}", file_.path(), prefix_, name, found, expected);
  }

 private:
  const TorchFile& file_;
  const std::string& prefix_;
};

int position_grid(const Shapes& shapes, const std::string& name) {
  const int positions = shapes.side(name, 3, 1);
  const int grid = static_cast<int>(std::lround(std::sqrt(static_cast<double>(positions - 1))));
  if (grid < 1 || grid * grid != positions - 1)
    shapes.bad(name, positions, "a square and the class token's are expected");
  return grid;
}

// Deduces the fields of the encoder, which is the module `encoder`.
template <class Config>
void tell_encoder(const Shapes& shapes, const std::string& encoder, Deduced<Config>& out) {
  Config& c = out.config;
  c.patch = shapes.side(encoder + ".model.patch_embed.proj.weight", 4, 3);
  c.vit_dim = shapes.side(encoder + ".model.cls_token", 3, 2);
  c.vit_depth = shapes.count(encoder + ".model.blocks", "norm1.weight");
  out.fields = {"patch", "vit_dim", "vit_depth"};
}

template <class Config>
void tell_positions(const Shapes& shapes, const std::string& encoder, Deduced<Config>& out) {
  out.config.vit_pos_grid = position_grid(shapes, encoder + ".model.pos_embed");
  out.fields.emplace_back("vit_pos_grid");
}

int sh_degree(const Shapes& shapes) {
  const int rows = shapes.side("predictor.coarse_predictor.4.weight", 2, 0);
  Config c;
  for (c.sh_degree = 0; c.sh_degree <= 3; ++c.sh_degree)
    if (c.primitive_size() == rows) return c.sh_degree;
  shapes.bad("predictor.coarse_predictor.4.weight", rows, "11 + 3 (degree + 1)^2 are expected");
}

}  // namespace

namespace {

// K primitives of 8 + D + 3 S values each, and F features besides 3 S: two row counts determine all four. If several
// solutions exist, degree 1 is chosen, as in the published code.
void tell_primitives(const Shapes& shapes, LaraConfig& c) {
  const char* const coarse = "decoder.mlp_coarse.4.weight";
  const int rows = shapes.side(coarse, 2, 0), fine = shapes.side("decoder.mlp_fine.2.weight", 2, 0);
  for (const int degree : {1, 0, 2, 3})
    for (const char* kind : {"surfel", "gaussian"}) {
      c.sh_degree = degree, c.kind = kind;
      c.primitives = rows / c.primitive_size();
      c.fine_features = fine - 3 * c.sh_count();
      if (c.primitives >= 1 && c.primitives * c.primitive_size() == rows && c.fine_features >= 0) return;
    }
  shapes.bad(coarse, rows, "of each primitive 10 (surfels) or 11 (Gaussians) and 3 (degree + 1)^2 are expected");
}

}  // namespace

DeducedLaraConfig deduced_lara_config(const TorchFile& file, const std::string& prefix) {
  const Shapes shapes(file, prefix);
  DeducedLaraConfig out;
  LaraConfig& c = out.config;
  tell_encoder(shapes, "img_encoder", out);
  tell_positions(shapes, "img_encoder", out);
  c.volume_ch = shapes.side("vol_decoder.pos_embed", 5, 1);
  c.volume = shapes.side("vol_decoder.pos_embed", 5, 2);
  c.layers = shapes.count("vol_decoder.layers", "cnn.weight");
  c.view_slots = shapes.side("view_embed", 6, 1);
  c.view_ch = shapes.side("view_embed", 6, 2);
  c.out_ch = shapes.side("vol_decoder.deconv.weight", 5, 1);
  c.fine_hidden = shapes.side("decoder.mlp_fine.0.weight", 2, 0);
  tell_primitives(shapes, c);
  for (const char* field : {"volume_ch", "volume", "layers", "view_slots", "view_ch", "out_ch", "fine_hidden",
                            "primitives", "kind", "fine_features", "sh_degree"})
    out.fields.emplace_back(field);
  out.unknown = {"vit_heads", "heads", "fine_heads", "windows", "image", "offset_cells"};
  // A buffer that the network does not use, but the only tensor whose shape shows this field.
  if (file.find(prefix + "volume_grid") != nullptr) {
    c.feature_volume = shapes.side("volume_grid", 4, 0);
    out.fields.emplace_back("feature_volume");
  } else {
    out.unknown.emplace_back("feature_volume");
  }
  return out;
}

namespace {

// Deduces the fields of the densifier, after those of its backbone.
template <class Config>
void tell_densifier(const TorchFile& file, const std::string& prefix, Deduced<Config>& out) {
  const Shapes shapes(file, prefix);
  DensifyConfig& d = out.config.densify;
  d.channels.clear(), d.depths.clear(), d.upscale.clear();
  const int levels = shapes.count("dec", "up.skip.weight");
  for (int s = 0; s == 0 || s < levels; ++s) {
    const std::string level = fmt::format("dec.{}.", s);
    d.channels.push_back(shapes.side(level + "up.skip.weight", 2, 1));
    d.upscale.push_back(shapes.side(level + "up.delta_x.2.weight", 2, 0) / 3);
    d.depths.push_back(0);
    while (file.find(fmt::format("{}{}block{}.cpe.1.weight", prefix, level, d.depths.back())) != nullptr)
      ++d.depths.back();
    if (s > 0) continue;
    d.mlp_ratio = shapes.side(level + "block0.mlp.0.fc1.weight", 2, 0) / d.channels[0];
    d.frequencies = (shapes.side(level + "up.delta_f.1.weight", 2, 1) - d.channels[0]) / 6;
  }
  // One placeholder per level, since only shapes are computed with them.
  d.heads.assign(d.channels.size(), 1), d.patch.assign(d.channels.size(), 1);
  for (const char* field :
       {"densify.channels", "densify.depths", "densify.upscale", "densify.mlp_ratio", "densify.frequencies"})
    out.fields.emplace_back(field);
  for (const char* field : {"densify.heads", "densify.patch", "densify.top_k", "densify.cell"})
    out.unknown.emplace_back(field);
  for (const TensorEntry& entry : file.tensors()) {
    if (!entry.name.starts_with(prefix + "dec.0.mask.") && !entry.name.starts_with(prefix + "dec.0.head.")) continue;
    d.residual = entry.name.starts_with(prefix + "dec.0.head.");
    break;
  }
}

// The configuration of a network that extends another one's fields.
template <class Config, class Backbone>
Deduced<Config> on_top_of(const Deduced<Backbone>& backbone) {
  Deduced<Config> out;
  static_cast<Backbone&>(out.config) = backbone.config;
  out.fields = backbone.fields, out.kinds = backbone.kinds, out.unknown = backbone.unknown;
  return out;
}

}  // namespace

DeducedGendenConfig deduced_genden_config(const TorchFile& file, const std::string& prefix) {
  DeducedGendenConfig out = on_top_of<GendenConfig>(deduced_lara_config(file, prefix));
  tell_densifier(file, prefix, out);
  return out;
}

DeducedVsplatGendenConfig deduced_vsplat_genden_config(const TorchFile& file, const std::string& prefix) {
  DeducedVsplatGendenConfig out = on_top_of<VsplatGendenConfig>(deduced_config(file, prefix));
  tell_densifier(file, prefix, out);
  return out;
}

DeducedConfig deduced_config(const TorchFile& file, const std::string& prefix) {
  const Shapes shapes(file, prefix);
  DeducedConfig out;
  Config& c = out.config;
  tell_encoder(shapes, "encoder", out);
  if (file.find(prefix + "encoder.model.reg_token") != nullptr) {
    c.encoder = "dinov3";
    c.vit_registers = shapes.side("encoder.model.reg_token", 3, 1);
    c.vit_qkv_bias = file.find(prefix + "encoder.model.blocks.0.attn.q_bias") != nullptr;
    out.kinds = {"encoder", "vit_registers", "vit_qkv_bias"};
  } else {
    tell_positions(shapes, "encoder", out);
  }
  c.volume_ch = shapes.side("volume_network.conv_out.weight", 5, 0);
  c.volume_mult.clear();
  const int levels = shapes.count("volume_network.down_blocks", "res.0.conv1.weight");
  for (int i = 0; i == 0 || i < levels; ++i)
    c.volume_mult.push_back(shapes.side(fmt::format("volume_network.down_blocks.{}.res.0.conv1.weight", i), 5, 0) /
                            c.volume_ch);
  c.voxel_ch = shapes.side("voxel_network.conv_in.weight", 5, 0);
  c.voxel_levels = shapes.count("voxel_network.conv_blocks", "res.0.conv1.weight");
  c.fine_dim = shapes.side("voxel_network.conv_out.weight", 5, 0);
  c.refine_out_kernel = shapes.side("voxel_network.conv_out.weight", 5, 1);
  c.use_projected = shapes.side("voxel_network.comp_linear.weight", 2, 1) != c.volume_ch + kPositionValues;
  c.fine_count = shapes.side("div_offset", 2, 0);
  c.sh_degree = sh_degree(shapes);
  for (const char* field : {"volume_ch", "volume_mult", "voxel_ch", "voxel_levels", "fine_dim", "refine_out_kernel",
                            "use_projected", "fine_count", "sh_degree"})
    out.fields.emplace_back(field);
  out.unknown = {"vit_heads", "groups", "image", "volume"};
  return out;
}

}  // namespace vsplat
