// Losses on pictures, and what they are made of.
#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/diagnose/selftest/inputs/lara_picture.h"
#include "model/diagnose/selftest/inputs/random_scenes.h"
#include "model/diagnose/selftest/reference/exposure.h"
#include "model/diagnose/selftest/reference/loss.h"
#include "model/diagnose/selftest/reference/lpips.h"
#include "model/diagnose/selftest/reference/picture_target.h"
#include "model/diagnose/selftest/reference/surface_loss.h"
#include "model/ops/fit/exposure.h"
#include "model/ops/fit/loss.h"
#include "model/ops/fit/lpips.h"
#include "model/ops/fit/picture_target.h"
#include "model/ops/fit/surface_loss.h"
#include "model/ops/networks/lara_maps.h"
#include "model/ops/render/area_mean.h"
#include "model/ops/render/project.h"
#include "runtime/gemm.h"

namespace vsplat::selftest {
namespace {

std::size_t picture_size(long a, long b = 1) { return static_cast<std::size_t>(a * b); }
constexpr std::array<float, 3> kBehindPictures = {0.2f, 0.9f, 0.5f};

// Central differences of a function of the numbers `at`, of every `stride`-th and the last.
template <class Loss>
std::vector<double> differences_of(std::vector<double> at, double step, const Loss& loss) {
  std::vector<double> out;
  for (double& x : at) {
    const double here = x;
    x = here + step;
    const double up = loss(at);
    x = here - step;
    out.push_back((up - loss(at)) / (2 * step));
    x = here;
  }
  return out;
}

// Pictures that are their target but for some noise: none near 0, 1 or the target, where the loss has kinks.
std::vector<float> off_target(const std::vector<float>& target, std::uint32_t seed) {
  auto out = random_floats(target.size(), seed, -0.3f, 0.3f);
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (std::abs(out[i]) < 1e-3f) out[i] = 2e-3f;
    out[i] += target[i];
    if (std::abs(out[i]) < 1e-3f || std::abs(out[i] - 1) < 1e-3f) out[i] += 3e-3f;
  }
  return out;
}

void loss_of(Checks& c, long n, long h, long w, ErrorKind error, SimilarityKind similarity) {
  const auto target = random_floats(picture_size(n * h, 3 * w), 1, 0, 1), pictures = off_target(target, 2);
  const Shape shape{n, h, w, 3};
  PictureLoss a{c.up(shape, pictures), c.up(shape, target), 0.4f, c.gap({3}), c.gap(shape)};
  a.error = error, a.similarity = similarity;
  picture_loss(c.ctx, a);
  const ref::LossKind kind{error == ErrorKind::absolute, similarity == SimilarityKind::single_scale,
                           similarity != SimilarityKind::none};
  const auto wide = as_doubles(pictures);
  const auto weight = static_cast<double>(0.4f);
  c.close(
      "loss", a.out,
      [&] {
        const auto want = ref::loss(wide, target, h, w, weight, kind);
        return std::vector<double>(want.begin(), want.end());
      },
      1e-6);
  const auto got = c.ctx.read<float>(a.dpictures);
  const std::size_t stride = 1 + got.size() / (got.size() > 20000 ? 7 : 40);
  std::vector<float> some;
  for (std::size_t at = 0; at < got.size(); at += stride) some.push_back(got[at]);
  c.close(
      "gradient", some,
      [&] {
        std::vector<double> out;
        for (std::size_t at = 0; at < got.size(); at += stride)
          out.push_back(ref::loss_slope(wide, target, h, w, weight, at, kind));
        return out;
      },
      2e-5);
  // All of it, by what no kernel leaves out.
  bool finite = true;
  for (const float v : got) finite = finite && std::isfinite(v);
  c.that("gradient, every number", finite);
}

void loss_all(Checks& c) {
  for (const auto& [n, h, w] :
       c.some({std::array<long, 3>{1, 11, 11}, {2, 12, 11}, {1, 13, 31}, {3, 21, 22}, {1, 33, 32}}))
    loss_of(c, n, h, w, ErrorKind::squared, SimilarityKind::automatic);
  loss_of(c, 1, 161, 162, ErrorKind::squared, SimilarityKind::automatic);  // five scales
  loss_of(c, 2, 12, 13, ErrorKind::absolute, SimilarityKind::automatic);
  loss_of(c, 2, 12, 13, ErrorKind::squared, SimilarityKind::none);
  loss_of(c, 1, 12, 13, ErrorKind::absolute, SimilarityKind::none);
}

void lpips_all(Checks& c) {
  struct Try {
    int height, width, channels, outs;
    Window2d window;
  };
  for (const Try& t : c.some({Try{1, 1, 1, 1, {1, 1, 0}},
                              {3, 7, 3, 5, {3, 1, 1}},
                              {11, 13, 3, 7, {11, 4, 2}},
                              {17, 31, 3, 33, {5, 1, 2}}})) {
    const auto taps = picture_size(t.window.side, t.window.side), cin = picture_size(t.channels),
               cout = picture_size(t.outs);
    const auto in = random_floats(picture_size(t.height, t.width) * cin, 1), w = random_floats(cout * cin * taps, 2);
    std::vector<float> last(w.size());
    for (std::size_t i = 0; i < w.size(); ++i) last[(i / (cin * taps) * taps + i % taps) * cin + i / taps % cin] = w[i];
    const long k = static_cast<long>(taps * cin), places = t.window.places(t.height) * t.window.places(t.width);
    const PackedMatrix packed = pack_matrix(c.ctx, last.data(), k, t.outs, 1, k, "w");
    Gemm g;
    g.a.x0 = c.up({t.height, t.width, t.channels}, in), g.a.map = picture_map(c.ctx, t.height, t.width, t.window);
    g.b = &packed, g.out = c.gap({places, t.outs});
    c.that("map's shape", g.a.map.shape() == Shape{places, static_cast<long>(taps)});
    gemm(c.ctx, g);
    c.close("convolution by a map", g.out,
            ref::conv2d(in, t.height, t.width, t.channels, w, t.outs, static_cast<int>(t.window.side),
                        static_cast<int>(t.window.stride), static_cast<int>(t.window.pad)),
            1e-5);
  }
  for (const auto& [h, w, channels] : c.some({std::array<int, 3>{3, 3, 7}, {7, 8, 3}, {13, 9, 64}, {8, 17, 65}})) {
    const auto in = random_floats(picture_size(h, w) * picture_size(channels), 3, -2, -1);
    const Tensor picture = c.up({h, w, channels}, in);
    c.close("largest of windows", max_pool(c.ctx, picture, {3, 2, 0}), ref::max_pool(in, h, w, channels, 3, 2), 0);
  }
  for (const long n : c.some({1L, 63L, 64L, 65L, 1009L})) {
    const auto x = random_floats(picture_size(n), 4);
    std::vector<float> want = x;
    for (float& v : want) v = v > 0 ? v : 0;
    const Tensor t = c.up({n}, x);
    relu(c.ctx, t);
    c.equal("ReLU", t, want);
  }
  for (const auto& [places, channels] : c.some({std::array<long, 2>{3, 7}, {7, 3}, {65, 64}, {64, 65}, {13, 512}})) {
    const auto a = random_floats(picture_size(places, channels), 5, 0, 1), b = random_floats(a.size(), 6, -0.5f, 1),
               weight = random_floats(picture_size(channels), 7, 0.1f, 1);
    const Tensor out = c.gap({places});
    feature_distance(c.ctx, {c.up({places, channels}, a), c.up({places, channels}, b), c.up({channels}, weight), out});
    c.close("distance", out, ref::feature_distance(a, b, weight), 1e-5);
  }
}

void lara_maps_all(Checks& c) {
  for (const auto& [w, h] : c.some({std::array<int, 2>{3, 3}, {2, 17}, {7, 13}, {17, 5}})) {
    const LaraPicture m(w, h);
    const Shape map{h, w}, vectors{h, w, 3};
    const DevicePicture picture{c.up(vectors, m.colour), c.up(map, m.alpha), c.up(map, m.depth),
                                c.up(vectors, m.normal)};
    const Tensor views = upload_views(c.ctx, {m.camera}, 0.2f, {});
    const LaraMaps got = lara_maps_forward(c.ctx, {picture, views, 0});
    const ref::PictureMaps wide = m.wide();
    const ref::LaraMaps want = ref::lara_maps(wide, m.camera, wide.alpha);
    c.close("colour", got.image, want.image, 1e-6);
    c.close("depth", got.depth, want.depth, 1e-6);
    c.close("normal", got.normal, want.normal, 1e-6);
    c.close("normal of depths", got.depth_normal, want.depth_normal, 3e-5);
    const auto to = LaraCotangent::random(m);
    const PictureGradient by =
        lara_maps_backward(c.ctx, {picture,
                                   views,
                                   0,
                                   {c.up(vectors, to.image), c.up(map, to.alpha), c.up(map, to.depth),
                                    c.up(vectors, to.normal), c.up(vectors, to.depth_normal), c.up(map, to.alpha)}});
    const auto differences = [&](std::vector<double> ref::PictureMaps::*field) { return to.differences(m, field); };
    c.close(
        "backward, colour", by.colour, [&] { return differences(&ref::PictureMaps::colour); }, 1e-5);
    c.close(
        "backward, alpha", by.alpha, [&] { return differences(&ref::PictureMaps::alpha); }, 5e-5);
    c.close(
        "backward, depth", by.depth, [&] { return differences(&ref::PictureMaps::depth); }, 5e-5);
    c.close(
        "backward, normal", by.normal, [&] { return differences(&ref::PictureMaps::normal); }, 1e-5);
    c.equal("backward, distortion", by.distortion, to.alpha);
  }
}

void surface_loss_all(Checks& c) {
  for (const auto& [h, w] : c.some({std::array<long, 2>{1, 1}, {7, 3}, {31, 11}, {1, 2047}, {32, 64}, {97, 61}})) {
    const std::size_t n = picture_size(h, w);
    const auto normal = random_floats(3 * n, 1), depth_normal = random_floats(3 * n, 2),
               alpha = random_floats(n, 3, 0, 1), distortion = random_floats(n, 4, 0, 0.1f);
    const Shape vectors{h, w, 3}, map{h, w};
    SurfaceLoss a;
    a.normal = c.up(vectors, normal), a.depth_normal = c.up(vectors, depth_normal);
    a.alpha = c.up(map, alpha), a.distortion = c.up(map, distortion), a.weights = {7, 0.3f};
    a.value = c.up({3}, std::vector<float>{2, 3, 4}), a.gradient_scale = 0.25f;
    a.dnormal = c.gap(vectors), a.ddepth_normal = c.gap(vectors), a.ddistortion = c.gap(map);
    surface_loss(c.ctx, a);
    const double value = ref::surface_loss(as_doubles(normal), as_doubles(depth_normal), as_doubles(alpha),
                                           as_doubles(distortion), 7, static_cast<double>(0.3f));
    c.close("loss", a.value, std::vector<double>{2 + value, 3, 4}, 1e-6);
    // Linear in each map: d/dn = -w alpha depth_normal / N, and so on.
    const double each = 0.25 / static_cast<double>(n), by = -static_cast<double>(0.3f) * each;
    std::vector<double> dnormal, ddepth_normal;
    for (std::size_t i = 0; i < 3 * n; ++i) {
      dnormal.push_back(by * alpha[i / 3] * depth_normal[i]);
      ddepth_normal.push_back(by * alpha[i / 3] * normal[i]);
    }
    c.close("gradient, normal", a.dnormal, dnormal, 1e-5);
    c.close("gradient, normal of depths", a.ddepth_normal, ddepth_normal, 1e-5);
    c.close("gradient, distortion", a.ddistortion, std::vector<double>(n, 7 * each), 1e-5);
  }
}

void area_mean_all(Checks& c) {
  for (const auto& [h, w] : c.some({std::array<long, 2>{1, 1}, {3, 7}, {16, 15}, {17, 33}}))
    for (const long k : {2L, 3L}) {
      const auto x = random_floats(picture_size(k * h, 3 * k * w), static_cast<std::uint32_t>(h + w + k));
      std::vector<double> want(picture_size(h, 3 * w));
      const auto wide = static_cast<std::size_t>(w), by = static_cast<std::size_t>(k);
      for (std::size_t i = 0; i < x.size(); ++i)
        want[(i / (3 * by * wide) / by * wide + i / 3 % (by * wide) / by) * 3 + i % 3] +=
            static_cast<double>(x[i]) / static_cast<double>(k * k);
      const Tensor out = c.gap({h, w, 3});
      area_mean(c.ctx, {c.up({k * h, k * w, 3}, x), out, static_cast<int>(k)});
      c.close("means", out, want, 1e-6);
    }
}

void picture_target_all(Checks& c) {
  for (const auto& [h, w] : c.some({std::array<long, 2>{1, 1}, {3, 1}, {7, 9}, {8, 8}, {5, 13}, {31, 37}})) {
    const std::size_t n = picture_size(h, w);
    std::vector<std::uint8_t> given, known;
    std::vector<float> colour, alpha;
    const auto random = random_floats(8 * n, static_cast<std::uint32_t>(97 * h + w), 0, 1);
    for (std::size_t i = 0; i < n; ++i) {
      const float* r = &random[8 * i];
      const int a = i % 3 == 0 ? 255 : i % 3 == 1 ? static_cast<int>(255 * r[0]) : 0;
      for (int k = 1; k < 4; ++k) given.push_back(static_cast<std::uint8_t>(static_cast<float>(a) * r[k]));
      given.push_back(static_cast<std::uint8_t>(a));
      known.push_back(i > 0 && r[4] < 0.3f ? 0 : 255);
      for (int k = 1; k < 4; ++k) colour.push_back(2 * r[k + 3] - 0.5f);
      float off = (r[0] - 0.5f) * (i % 2 == 0 ? 3.0f : 200.0f);
      if (std::abs(std::abs(off) - 0.5f) < 1e-2f) off += 0.1f;
      alpha.push_back((static_cast<float>(a) + off) / 255);
    }
    std::vector<double> target, dalpha;
    for (std::size_t i = 0; i < n; ++i) {
      std::array<double, 3> background{}, drawn{};
      for (std::size_t k = 0; k < 3; ++k) background[k] = kBehindPictures[k], drawn[k] = colour[3 * i + k];
      const auto want = ref::pixel_target(&given[4 * i], known[i] != 0, background, drawn, alpha[i],
                                          static_cast<double>(0.3f) / static_cast<double>(n));
      target.insert(target.end(), want.colour.begin(), want.colour.end());
      dalpha.push_back(want.dalpha);
    }
    PictureTarget a;
    a.given = c.ctx.upload({h, w, 4}, given, Type::u8), a.known = c.ctx.upload({h, w}, known, Type::u8);
    a.background = kBehindPictures, a.alpha_weight = 0.3f;
    a.drawn.colour = c.up({h, w, 3}, colour), a.drawn.alpha = c.up({h, w}, alpha);
    a.target = c.gap({h, w, 3}), a.dalpha = c.gap({h, w});
    picture_target(c.ctx, a);
    c.close("target", a.target, target, 1e-6);
    c.close("gradient of alpha", a.dalpha, dalpha, 1e-6);
  }
}

void exposure_all(Checks& c) {
  for (const auto& [h, w] : c.some({std::array<long, 2>{1, 1}, {1, 7}, {5, 11}, {16, 16}, {1, 257}})) {
    const std::size_t n = picture_size(h, w);
    const auto map = random_floats(12, 1), colour = random_floats(3 * n, 2, -0.5f, 1.5f),
               alpha = random_floats(n, 3, 0, 1), by = random_floats(3 * n, 4), dalpha = random_floats(n, 5);
    const DevicePicture drawn{c.up({h, w, 3}, colour), c.up({h, w}, alpha), {}};
    const Tensor m = c.up({12}, map), out = c.gap({h, w, 3}), dmap = c.gap({12});
    exposure_forward(c.ctx, {m, drawn, kBehindPictures, out});
    const std::array<double, 3> behind{kBehindPictures[0], kBehindPictures[1], kBehindPictures[2]};
    const auto dm = as_doubles(map), dc = as_doubles(colour), da = as_doubles(alpha);
    c.close("forward", out, ref::exposure(dm, dc, da, behind), 1e-6);
    const PictureGradient to{c.up({h, w, 3}, by), c.up({h, w}, dalpha), {}};
    exposure_backward(c.ctx, {m, drawn, kBehindPictures, to, dmap});
    const auto value = [&](const auto& x, const auto& y, const auto& z) {
      const auto shown = ref::exposure(x, y, z, behind);
      double sum = 0;
      for (std::size_t i = 0; i < shown.size(); ++i) sum += by[i] * shown[i];
      return sum;
    };
    c.close(
        "backward, dmap", dmap, [&] { return differences_of(dm, 1, [&](const auto& x) { return value(x, dc, da); }); },
        2e-6);
    c.close(
        "backward, colour", to.colour,
        [&] { return differences_of(dc, 1, [&](const auto& x) { return value(dm, x, da); }); }, 2e-6);
    c.close(
        "backward, alpha", to.alpha,
        [&] {
          auto sums = differences_of(da, 1, [&](const auto& x) { return value(dm, dc, x); });
          for (std::size_t i = 0; i < n; ++i) sums[i] += dalpha[i];
          return sums;
        },
        2e-6);
  }
}

}  // namespace

std::vector<Case> picture_cases() {
  return {{"loss", loss_all},
          {"lpips", lpips_all},
          {"lara_maps", lara_maps_all},
          {"surface_loss", surface_loss_all},
          {"picture_target", picture_target_all},
          {"area_mean", area_mean_all},
          {"exposure", exposure_all}};
}

}  // namespace vsplat::selftest
