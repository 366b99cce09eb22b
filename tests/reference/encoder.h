// The encoder and the pose modulation in double, from the weights by name.
#pragma once
#include <map>
#include <string>
#include <vector>

#include "model/diagnose/selftest/reference/attention.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "model/diagnose/selftest/reference/layernorm.h"
#include "model/diagnose/selftest/reference/patch_embed.h"
#include "model/diagnose/selftest/reference/position_resample.h"
#include "model/networks/params/config.h"

namespace vsplat::ref {

struct Encoder {
  using Row = std::vector<double>;

  Config config;
  std::map<std::string, Row> weights;  // of the whole model, by the state dict's names

  const Row& at(const std::string& name) const { return weights.at(name); }
  std::size_t width() const { return static_cast<std::size_t>(config.vit_dim); }
  std::size_t along() const { return static_cast<std::size_t>(config.tokens()); }
  std::size_t patches() const { return along() * along(); }

  // x [rows, in] -> [rows, out]
  Row linear(const std::string& name, const Row& x) const {
    const Row &w = at(name + ".weight"), &b = at(name + ".bias");
    const std::size_t n = b.size(), k = w.size() / n;
    Row y;
    for (std::size_t r = 0; r < x.size(); r += k)
      for (std::size_t j = 0; j < n; ++j) {
        double sum = b[j];
        for (std::size_t i = 0; i < k; ++i) sum += w[j * k + i] * x[r + i];
        y.push_back(sum);
      }
    return y;
  }

  Row norm(const std::string& name, const Row& x) const {
    return layernorm(x, width(), at(name + ".weight"), at(name + ".bias"), 1e-6);
  }

  static void add(Row& x, const Row& y) {
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += y[i];
  }

  // images [v, s, s, 3] -> [v, 1 + t t, c] after the final norm
  Row tokens(const std::vector<float>& images, std::size_t v) const {
    const std::string model = "encoder.model.";
    const std::size_t c = width(), g = static_cast<std::size_t>(config.vit_pos_grid);
    const Row& stored = at(model + "pos_embed");
    Row position(stored.begin(), stored.begin() + config.vit_dim);
    add(position, at(model + "cls_token"));
    const Row grid = resample(Row(stored.begin() + config.vit_dim, stored.end()), g, along(), c);
    position.insert(position.end(), grid.begin(), grid.end());
    const auto edge = static_cast<std::size_t>(config.image);
    Row x = patch_embed(images, {v, edge, edge, static_cast<std::size_t>(config.patch)},
                        at(model + "patch_embed.proj.weight"), at(model + "patch_embed.proj.bias"), position);
    for (int i = 0; i < config.vit_depth; ++i) {
      const std::string block = model + "blocks." + std::to_string(i) + ".";
      const Row qkv = linear(block + "attn.qkv", norm(block + "norm1", x));
      const long heads = config.vit_heads, t = 1 + static_cast<long>(patches());
      add(x, linear(block + "attn.proj", attention(qkv, static_cast<long>(v), t, heads, config.vit_dim / heads)));
      Row hidden = linear(block + "mlp.fc1", norm(block + "norm2", x));
      for (double& h : hidden) h = gelu(h);
      add(x, linear(block + "mlp.fc2", hidden));
    }
    return norm(model + "norm", x);
  }

  // x [v, 1 + t t, c], rays [v t t, 32] -> [v, t, t, c]
  Row modulated(const Row& x, const Row& rays) const {
    Row hidden = linear("dir_norm.mlp.0", rays);
    for (double& h : hidden) h = silu(h);
    const Row film = linear("dir_norm.mlp.2", hidden), normed = norm("dir_norm.norm", x);
    const std::size_t c = width();
    Row out;
    for (std::size_t row = 0; row < rays.size() / 32; ++row) {
      const std::size_t token = row / patches() * (1 + patches()) + 1 + row % patches();
      for (std::size_t i = 0; i < c; ++i)
        out.push_back(normed[token * c + i] * (1 + film[(2 * row + 1) * c + i]) + film[2 * row * c + i]);
    }
    return out;
  }
};

}  // namespace vsplat::ref
