#include "model/params/params.h"

#include <fmt/format.h>

#include <utility>

namespace vsplat {
namespace {

constexpr int kPositionEncoding = 63;  // x, then sine and cosine of 10 octaves, three values each
constexpr int kRayEncoding = 32;       // spherical harmonics to degree 3 of a ray's direction and moment

class List {
 public:
  std::vector<Parameter> take() { return std::move(all_); }

  void add(const std::string& name, Shape shape, Init init, long fan_in = 0, long fan_out = 0) {
    all_.push_back({name, std::move(shape), init, fan_in, fan_out});
  }
  void buffer(const std::string& name, Shape shape, Init init) {
    add(name, std::move(shape), init);
    all_.back().trained = false;
  }
  void norm(const std::string& name, long channels) {
    add(name + ".weight", {channels}, Init::ones);
    add(name + ".bias", {channels}, Init::zeros);
  }
  void linear(const std::string& name, long in, long out) { dense(name, {out, in}); }
  void conv3d(const std::string& name, long in, long out, long k) { dense(name, {out, in, k, k, k}); }

  // A layer whose weight is [out, in, ...]: everything but the first size feeds one output.
  void dense(const std::string& name, Shape shape) {
    long fan_in = 1;
    for (std::size_t i = 1; i < shape.size(); ++i) fan_in *= shape[i];
    const long out = shape[0];
    add(name + ".weight", std::move(shape), Init::fan_in, fan_in);
    add(name + ".bias", {out}, Init::fan_in, fan_in);
  }
  void submanifold(const std::string& name, long in, long out, long k) {
    add(name + ".weight", {out, k, k, k, in}, Init::submanifold, in * k * k * k);
    add(name + ".bias", {out}, Init::zeros);
  }
  void mlp3(const std::string& name, long in, long out) {
    for (const char* layer : {".0", ".2", ".4"}) {
      const long to = layer == std::string(".4") ? out : in;
      add(name + layer + ".weight", {to, in}, Init::xavier, in, to);
      add(name + layer + ".bias", {to}, Init::zeros);
    }
  }
  void res_block(const std::string& name, long in, long out) {
    norm(name + ".norm1", in);
    conv3d(name + ".conv1", in, out, 3);
    norm(name + ".norm2", out);
    conv3d(name + ".conv2", out, out, 3);
    if (in != out) conv3d(name + ".nin_shortcut", in, out, 1);
  }
  void sparse_res_block(const std::string& name, long channels) {
    for (const char* half : {"1", "2"}) {
      norm(name + ".norm" + half + ".group_norm", channels);
      submanifold(name + ".conv" + half, channels, channels, 3);
    }
  }

 private:
  std::vector<Parameter> all_;
};

void encoder(List& list, const Config& c) {
  const std::string model = "encoder.model.";
  const long dim = c.vit_dim;
  list.add(model + "cls_token", {1, 1, dim}, Init::zeros);
  list.add(model + "pos_embed", {1, static_cast<long>(c.vit_pos_grid) * c.vit_pos_grid + 1, dim}, Init::position);
  list.dense(model + "patch_embed.proj", {dim, 3, c.patch, c.patch});
  for (int i = 0; i < c.vit_depth; ++i) {
    const std::string block = fmt::format("{}blocks.{}.", model, i);
    list.norm(block + "norm1", dim);
    list.linear(block + "attn.qkv", dim, 3 * dim);
    list.linear(block + "attn.proj", dim, dim);
    list.norm(block + "norm2", dim);
    list.linear(block + "mlp.fc1", dim, 4 * dim);
    list.linear(block + "mlp.fc2", 4 * dim, dim);
  }
  list.norm(model + "norm", dim);
}

void modulation(List& list, const Config& c) {
  list.norm("dir_norm.norm", c.vit_dim);
  list.linear("dir_norm.mlp.0", kRayEncoding, c.vit_dim);
  list.linear("dir_norm.mlp.2", c.vit_dim, 2L * c.vit_dim);
}

void volume_network(List& list, const Config& c) {
  const std::string net = "volume_network.";
  const long ch = c.volume_ch;
  list.conv3d(net + "conv_in.0", 2L * c.vit_dim, 4 * ch, 1);
  list.norm(net + "conv_in.1", 4 * ch);
  list.conv3d(net + "conv_in.3", 4 * ch, ch, 3);
  std::vector<long> skips = {ch};
  long width = ch;
  const int levels = static_cast<int>(c.volume_mult.size());
  for (int i = 0; i < levels; ++i) {
    const std::string level = fmt::format("{}down_blocks.{}.", net, i);
    list.res_block(level + "res.0", width, ch * c.volume_mult[i]);
    width = ch * c.volume_mult[i];
    skips.push_back(width);
    if (i + 1 < levels) {
      list.conv3d(level + "downsample.conv", width, width, 2);
      skips.push_back(width);
    }
  }
  list.res_block(net + "mid.0", width, width);
  for (int i = 0; i < levels; ++i) {
    const long out = ch * c.volume_mult[levels - 1 - i];
    for (int block = 0; block < 2; ++block) {
      list.res_block(fmt::format("{}up_blocks.{}.res.{}", net, i, block), width + skips.back(), out);
      skips.pop_back();
      width = out;
    }
  }
  list.norm(net + "norm_out", width);
  list.conv3d(net + "conv_out", width, ch, 3);
}

void voxel_network(List& list, const Config& c) {
  const std::string net = "voxel_network.";
  const long ch = c.voxel_ch;
  list.linear(net + "comp_linear", c.projected_ch() + c.volume_ch + kPositionEncoding, ch);
  list.submanifold(net + "conv_in", ch, ch, 3);
  for (int i = 0; i < c.voxel_levels; ++i)
    for (int block = 0; block < 2; ++block)
      list.sparse_res_block(fmt::format("{}conv_blocks.{}.res.{}", net, i, block), ch);
  list.norm(net + "norm_out.group_norm", ch + c.projected_ch());
  list.submanifold(net + "conv_out", ch + c.projected_ch(), c.fine_dim, c.refine_out_kernel);
}

void predictors(List& list, const Config& c) {
  const long primitive = c.primitive_size();
  list.mlp3("predictor.act_predictor", c.volume_ch, 1);
  list.mlp3("predictor.coarse_predictor", c.volume_ch, primitive);
  list.mlp3("predictor.fine_predictor", c.fine_dim, c.fine_count * primitive);
  list.mlp3("predictor.update_predictor", c.fine_dim, 1 + 3L * c.sh_count());
}

}  // namespace

long Parameter::count() const {
  long n = 1;
  for (const long side : shape) n *= side;
  return n;
}

std::vector<Parameter> parameters(const Config& config) {
  List list;
  list.buffer("div_offset", {config.fine_count, 3}, Init::sobol);
  encoder(list, config);
  modulation(list, config);
  volume_network(list, config);
  voxel_network(list, config);
  predictors(list, config);
  return list.take();
}

bool is_used(const Config& config, const std::string& name) {
  const auto begins = [&](const char* with) { return name.rfind(with, 0) == 0; };
  if (begins("predictor.act_predictor.")) return config.levels != "coarse" && config.selection != "opacity";
  if (begins("voxel_network.") || begins("predictor.fine_predictor.") || begins("predictor.update_predictor."))
    return config.levels == "fine";
  return true;
}

bool decays(const std::string& name) {
  const auto ends = [&](const std::string& with) {
    return name.size() >= with.size() && name.compare(name.size() - with.size(), with.size(), with) == 0;
  };
  if (ends(".bias")) return false;
  const bool layer_norms = name.rfind("encoder.model.", 0) == 0 || name.rfind("dir_norm.", 0) == 0;
  return !layer_norms || !(ends("norm.weight") || ends("norm1.weight") || ends("norm2.weight"));
}

long parameter_count(const Config& config) {
  long n = 0;
  for (const Parameter& parameter : parameters(config))
    if (parameter.trained) n += parameter.count();
  return n;
}

}  // namespace vsplat
