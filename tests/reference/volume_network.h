// The volume network in double, from its definition: layer after layer, nothing fused.
#pragma once
#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "model/diagnose/selftest/reference/gemm.h"
#include "model/diagnose/selftest/reference/groupnorm.h"
#include "model/diagnose/selftest/reference/upsample3d.h"
#include "model/networks/params/config.h"

namespace vsplat::ref {

struct Volume {
  std::vector<double> x;  // [edge^3, channels]
  long edge = 0, channels = 0;
};

class VolumeNetwork {
 public:
  // By their names without "volume_network."; may be changed between runs.
  std::map<std::string, std::vector<double>> weights;
  Config config;

  Volume run(const std::vector<double>& in) const {
    const auto levels = config.volume_mult.size();
    Volume h = conv(norm_silu({in, config.volume, 4L * config.volume_ch}, "conv_in.1"), "conv_in.3", 3);
    std::vector<Volume> skips = {h};
    for (std::size_t i = 0; i < levels; ++i) {
      const std::string level = "down_blocks." + std::to_string(i);
      h = res(h, level + ".res.0");
      skips.push_back(h);
      if (i + 1 == levels) break;
      h = conv(h, level + ".downsample.conv", 2);
      skips.push_back(h);
    }
    h = res(h, "mid.0");
    for (std::size_t i = 0; i < levels; ++i) {
      const std::string level = "up_blocks." + std::to_string(i);
      for (const char* block : {".res.0", ".res.1"}) {
        h = res(beside(h, skips.back()), level + block);
        skips.pop_back();
      }
      if (i + 1 < levels) h = {upsample3d(h.x, h.edge, h.edge, h.edge, h.channels), 2 * h.edge, h.channels};
    }
    return conv(norm_silu(h, "norm_out"), "conv_out", 3);
  }

 private:
  static std::size_t u(long v) { return static_cast<std::size_t>(v); }
  const std::vector<double>& weight(const std::string& name) const { return weights.at(name + ".weight"); }
  const std::vector<double>& bias(const std::string& name) const { return weights.at(name + ".bias"); }

  // side 3: padding 1; side 2: stride 2; side 1: neither.
  Volume conv(const Volume& in, const std::string& name, long side) const {
    const std::vector<double>&w = weight(name), &b = bias(name);
    const long stride = side == 2 ? 2 : 1, padding = side == 3 ? 1 : 0, n = static_cast<long>(b.size());
    Volume out{{}, in.edge / stride, n};
    const long cells = out.edge * out.edge * out.edge, e = out.edge;
    for (long p = 0; p < cells; ++p) {
      std::vector<double> sums = b;
      for (long tap = 0; tap < side * side * side; ++tap) {
        const long x = p / (e * e) * stride + tap / (side * side) - padding;
        const long y = p / e % e * stride + tap / side % side - padding, z = p % e * stride + tap % side - padding;
        if (std::min({x, y, z}) < 0 || std::max({x, y, z}) >= in.edge) continue;
        const double* from = &in.x[u(((x * in.edge + y) * in.edge + z) * in.channels)];
        for (long j = 0; j < n; ++j)
          for (long c = 0; c < in.channels; ++c)
            sums[u(j)] += w[u((j * in.channels + c) * side * side * side + tap)] * from[c];
      }
      out.x.insert(out.x.end(), sums.begin(), sums.end());
    }
    return out;
  }

  Volume norm_silu(Volume v, const std::string& name) const {
    v.x = groupnorm(v.x, v.x.size() / u(v.channels), u(v.channels), u(config.groups), weight(name), bias(name), 1e-6);
    for (double& x : v.x) x = silu(x);
    return v;
  }

  static Volume beside(const Volume& a, const Volume& b) {
    Volume out{{}, a.edge, a.channels + b.channels};
    for (long p = 0; p < a.edge * a.edge * a.edge; ++p) {
      out.x.insert(out.x.end(), &a.x[u(p * a.channels)], &a.x[u(p * a.channels)] + a.channels);
      out.x.insert(out.x.end(), &b.x[u(p * b.channels)], &b.x[u(p * b.channels)] + b.channels);
    }
    return out;
  }

  Volume res(const Volume& in, const std::string& name) const {
    Volume h = conv(norm_silu(in, name + ".norm1"), name + ".conv1", 3);
    h = conv(norm_silu(h, name + ".norm2"), name + ".conv2", 3);
    const Volume x = weights.contains(name + ".nin_shortcut.bias") ? conv(in, name + ".nin_shortcut", 1) : in;
    for (std::size_t i = 0; i < h.x.size(); ++i) h.x[i] += x.x[i];
    return h;
  }
};

}  // namespace vsplat::ref
