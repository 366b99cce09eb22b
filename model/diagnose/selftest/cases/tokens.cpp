// Pictures to tokens, positions, and rays.
#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/camera_ring.h"
#include "model/diagnose/selftest/reference/patch_embed.h"
#include "model/diagnose/selftest/reference/plucker.h"
#include "model/diagnose/selftest/reference/position_encoding.h"
#include "model/diagnose/selftest/reference/position_resample.h"
#include "model/diagnose/selftest/reference/ray_harmonics.h"
#include "model/diagnose/selftest/reference/ray_loss.h"
#include "model/ops/dense/patch_embed.h"
#include "model/ops/dense/position_resample.h"
#include "model/ops/networks/plucker.h"
#include "model/ops/networks/position_encoding.h"
#include "model/ops/networks/ray_harmonics.h"
#include "model/ops/networks/ray_loss.h"

namespace vsplat::selftest {
namespace {

std::size_t token_size(long a, long b = 1) { return static_cast<std::size_t>(a * b); }

std::vector<double> and_before(std::vector<double> sums, const std::vector<float>& before) {
  for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += before[i];
  return sums;
}

void patch_embed_all(Checks& c) {
  struct Try {
    ref::PatchSizes z;
    long channels;
  };
  for (const Try& t : c.some({Try{{1, 1, 1, 1}, 1},
                              {{2, 6, 6, 3}, 7},
                              {{3, 21, 21, 7}, 12},
                              {{1, 48, 48, 16}, 33},
                              {{4, 36, 36, 3}, 65},
                              {{2, 6, 10, 2, 5, false}, 7},
                              {{1, 3, 6, 3, 0}, 6}})) {
    const auto& z = t.z;
    const long k = static_cast<long>(3 * z.p * z.p), v = static_cast<long>(z.v), p = static_cast<long>(z.p),
               tokens = static_cast<long>(z.tokens()), rows = static_cast<long>(z.rows());
    const auto images = random_floats(z.v * z.height * z.width * 3, 1, 0, 1),
               weight = random_floats(token_size(t.channels, k), 2), bias = random_floats(token_size(t.channels), 3),
               position = random_floats(token_size(rows, t.channels), 4, -5, 5),
               dtokens = random_floats(token_size(v * tokens, t.channels), 5);
    const PackedMatrix packed = pack_matrix(c.ctx, weight.data(), k, t.channels, 1, k, "weight");
    const PatchEmbedForward f{c.up({v, static_cast<long>(z.height), static_cast<long>(z.width), 3}, images),
                              static_cast<int>(z.p),
                              &packed,
                              c.up({t.channels}, bias),
                              c.up({rows, t.channels}, position),
                              c.gap({v, tokens, t.channels})};
    patch_embed_forward(c.ctx, f);
    c.close(
        "forward", f.out, [&] { return ref::patch_embed(images, z, weight, bias, position); }, 1e-5);
    const PatchEmbedBackward b{f.images,
                               static_cast<int>(z.p),
                               c.up({v, tokens, t.channels}, dtokens),
                               c.zeros({t.channels, 3, p, p}),
                               c.zeros({t.channels}),
                               c.gap({rows, t.channels})};
    patch_embed_backward(c.ctx, b);
    const auto want = ref::patch_embed_backward(images, z, token_size(t.channels), as_doubles(dtokens));
    c.close("backward, dweight", b.dweight, want.weight, 1e-5);
    c.close("backward, dbias", b.dbias, want.bias, 1e-5);
    if (rows > 0) c.close("backward, dposition", b.dposition, want.position, 1e-5);
  }
}

void position_resample_all(Checks& c) {
  for (const auto& [g, t, channels] :
       c.some({std::array<long, 3>{1, 1, 1}, {3, 7, 5}, {7, 3, 16}, {5, 16, 33}, {14, 9, 7}})) {
    const std::size_t n = token_size(channels);
    const auto stored = random_floats((1 + token_size(g, g)) * n, 1), token = random_floats(n, 2),
               dout = random_floats((1 + token_size(t, t)) * n, 3);
    const Tensor out = c.gap({1 + t * t, channels});
    position_resample_forward(c.ctx, {c.up({1 + g * g, channels}, stored), c.up({channels}, token), static_cast<int>(g),
                                      static_cast<int>(t), out});
    std::vector<double> want;
    for (std::size_t i = 0; i < n; ++i) want.push_back(static_cast<double>(stored[i]) + token[i]);
    const std::vector<float> grid(stored.begin() + channels, stored.end());
    for (const double v : ref::resample(grid, token_size(g), token_size(t), n)) want.push_back(v);
    c.close("forward", out, want, 1e-5);
    const Tensor dstored = c.zeros({1 + g * g, channels}), dtoken = c.zeros({channels});
    position_resample_backward(
        c.ctx, {c.up({1 + t * t, channels}, dout), static_cast<int>(g), static_cast<int>(t), dstored, dtoken});
    std::vector<double> by(dout.begin(), dout.begin() + channels);
    c.close("backward, dclass_token", dtoken, by, 1e-6);
    const std::vector<double> by_grid(dout.begin() + channels, dout.end());
    for (const double v : ref::resample_backward(by_grid, token_size(g), token_size(t), n)) by.push_back(v);
    c.close("backward, dstored", dstored, by, 1e-5);
  }
}

void position_encoding_all(Checks& c) {
  for (const long p : c.some({1L, 3L, 63L, 64L, 65L, 211L})) {
    const auto points = random_floats(token_size(3 * p), 1, -0.6f, 0.6f), dout = random_floats(token_size(p, 63), 2),
               before = random_floats(token_size(3 * p), 3);
    const Tensor in = c.up({p, 3}, points), out = c.gap({p, 63}), dpoints = c.up({p, 3}, before);
    position_encoding_forward(c.ctx, {in, out});
    c.close("forward", out, ref::position_encoding(points), 1e-6);
    position_encoding_backward(c.ctx, {in, c.up({p, 63}, dout), dpoints});
    c.close("backward", dpoints, and_before(ref::position_encoding_backward(points, dout), before), 1e-6);
  }
}

void plucker_all(Checks& c) {
  for (const auto& [views, size, patch] : c.some({std::array<int, 3>{1, 3, 3}, {3, 21, 7}, {2, 48, 16}})) {
    const auto cameras = orbit(views, size);
    const long t = size / patch;
    const Tensor out = c.gap({views, t, t, 32});
    plucker_forward(c.ctx, {upload_cameras(c.ctx, cameras), patch, out});
    std::vector<double> want;
    for (const Camera& camera : cameras)
      for (long i = 0; i < t * t; ++i) {
        Eigen::Vector3d direction, moment;
        ref::plucker(camera, (static_cast<double>(i % t) + 0.5) * patch, (static_cast<double>(i / t) + 0.5) * patch,
                     direction, moment);
        for (const Eigen::Vector3d& of : {direction, moment})
          for (const double v : ref::real_sh3(of)) want.push_back(v);
      }
    c.close("forward", out, want, 1e-6);
  }
}

void ray_harmonics_all(Checks& c) {
  for (const long r : c.some({1L, 7L, 64L, 65L, 101L})) {
    const auto rays = random_floats(token_size(6 * r), 1), dout = random_floats(token_size(32 * r), 2);
    const Tensor in = c.up({r, 6}, rays), out = c.gap({r, 32}), drays = c.gap({r, 6});
    ray_harmonics_forward(c.ctx, {in, out});
    c.close("forward", out, ref::ray_harmonics(as_doubles(rays)), 1e-6);
    ray_harmonics_backward(c.ctx, {in, c.up({r, 32}, dout), drays});
    c.close(
        "backward", drays, [&] { return ref::ray_harmonics_gradient(as_doubles(rays), dout); }, 1e-5);
  }
}

void ray_loss_all(Checks& c) {
  for (const long r : c.some({1L, 7L, 341L, 343L, 2049L})) {
    const auto predicted = random_floats(token_size(6 * r), 1), target = random_floats(token_size(6 * r), 2);
    const RayLoss a{c.up({r, 6}, predicted), c.up({r, 6}, target), c.gap({1}), c.gap({r, 6}), 0.25f};
    ray_loss(c.ctx, a);
    c.close("loss", a.out, std::vector<double>{ref::ray_loss(predicted, target)}, 1e-6);
    std::vector<double> by;
    for (std::size_t i = 0; i < target.size(); ++i)
      by.push_back(0.5 * (static_cast<double>(predicted[i]) - target[i]) / static_cast<double>(target.size()));
    c.close("gradient", a.dpredicted, by, 1e-6);
  }
}

}  // namespace

std::vector<Case> token_cases() {
  return {{"patch_embed", patch_embed_all},
          {"position_resample", position_resample_all},
          {"position_encoding", position_encoding_all},
          {"plucker", plucker_all},
          {"ray_harmonics", ray_harmonics_all},
          {"ray_loss", ray_loss_all}};
}

}  // namespace vsplat::selftest
