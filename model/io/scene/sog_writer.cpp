#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <thread>

#include "model/io/archive/memory_zip.h"
#include "model/io/scene/codebook.h"
#include "model/io/scene/morton_order.h"
#include "model/io/scene/scene_notes.h"
#include "model/io/scene/sh_palette.h"
#include "model/io/scene/sog.h"
#include "model/io/scene/webp_plane.h"
#include "model/io/scene/written_gaussians.h"
#include "runtime/fail.h"
#include "runtime/files/output_file.h"
#include "runtime/share_out.h"

namespace vsplat {
namespace {

using nlohmann::json;

constexpr std::size_t kPaletteRow = 64;    // vectors in a row of the palette's plane
constexpr double kLogarithmOfZero = -110;  // its exponential is 0 as a float
constexpr int kWidestWritten = kWidestPlane / 4 * 4;
constexpr std::size_t kMostWritten = std::size_t{kWidestWritten} * kWidestWritten;

// sign(x) log(1 + |x|), in which positions have even steps.
double log_position(float x) { return std::copysign(std::log1p(std::abs(static_cast<double>(x))), x); }

struct PositionRange {
  std::array<double, 3> mins{}, maxs{};

  explicit PositionRange(const Gaussians& g) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      float low = g.means[axis], high = low;
      for (std::size_t k = 0; k < g.count; ++k) {
        low = std::min(low, g.means[3 * k + axis]);
        high = std::max(high, g.means[3 * k + axis]);
      }
      mins[axis] = log_position(low);
      maxs[axis] = log_position(high);
    }
  }
  std::uint16_t step(std::size_t axis, float x) const {
    const double range = maxs[axis] - mins[axis];
    if (!(range > 0)) return 0;
    return static_cast<std::uint16_t>(
        std::clamp(std::round((log_position(x) - mins[axis]) / range * 65535), 0.0, 65535.0));
  }
};

// A vector of floats by Gaussian and channel, of which a codebook is made.
using Channels = std::vector<float>;

class SogPlanes {
 public:
  explicit SogPlanes(const Gaussians& g) : g_(g), range_(g), sh_count_(g.sh_count()) {
    // A multiple of 4, as other writers choose it.
    const double side = std::ceil(std::sqrt(static_cast<double>(g.count)) / 4) * 4;
    width_ = static_cast<int>(std::min(side, double{kWidestWritten}));
    const std::size_t rows = (g.count + static_cast<std::size_t>(width_) - 1) / static_cast<std::size_t>(width_);
    height_ = static_cast<int>((rows + 3) / 4 * 4);
    std::vector<std::array<std::uint16_t, 3>> steps(g.count);
    for (std::size_t k = 0; k < g.count; ++k)
      for (std::size_t axis = 0; axis < 3; ++axis) steps[k][axis] = range_.step(axis, g.means[3 * k + axis]);
    order_ = morton_order(steps);
    const int degree = std::min(g.sh_degree, 3);
    meta_ = {{"version", 2}, {"asset", {{"generator", "vsplat"}}}, {"count", g.count}};
    jobs_ = {[this] { scales(); }, [this] { colours(); }, [this] { means(); }, [this] { rotations(); }};
    meta_["means"] = {{"mins", range_.mins}, {"maxs", range_.maxs}, {"files", {"means_l.webp", "means_u.webp"}}};
    meta_["scales"] = {{"files", {"scales.webp"}}};
    meta_["quats"] = {{"files", {"quats.webp"}}};
    meta_["sh0"] = {{"files", {"sh0.webp"}}};
    names_ = {"means_l.webp", "means_u.webp", "scales.webp", "quats.webp", "sh0.webp"};
    if (degree > 0) {
      meta_["shN"] = {{"bands", degree}, {"files", {"shN_centroids.webp", "shN_labels.webp"}}};
      names_.insert(names_.end(), {"shN_centroids.webp", "shN_labels.webp"});
      harmonics(static_cast<std::size_t>((degree + 1) * (degree + 1) - 1));
    }
    bytes_.resize(names_.size());
    ShareOut shared;
    shared.items = jobs_.size();
    shared.workers = std::clamp(std::thread::hardware_concurrency(), 1u, 8u);
    shared.ahead = jobs_.size();
    shared.work = [this](std::size_t, std::size_t i) { jobs_[i](); };
    share_out(shared);
    if (degree > 0) meta_["shN"]["codebook"] = sh_codebook_;
    meta_["scales"]["codebook"] = scale_codebook_;
    meta_["sh0"]["codebook"] = colour_codebook_;
  }

  json& meta() { return meta_; }
  // The planes' files in order, which this moves out.
  std::vector<NamedBytes> take() {
    std::vector<NamedBytes> out;
    for (std::size_t i = 0; i < names_.size(); ++i) out.emplace_back(names_[i], std::move(bytes_[i]));
    return out;
  }

 private:
  // Encodes a plane whose texels `put(texel's bytes, Gaussian)` writes.
  template <class Put>
  void plane(std::size_t file, const Put& put) {
    WebpPlane out;
    out.width = width_;
    out.height = height_;
    out.rgba.resize(4 * out.texels());
    for (std::size_t i = 0; i < g_.count; ++i) {
      out.rgba[4 * i + 3] = 255;
      put(&out.rgba[4 * i], order_[i]);
    }
    bytes_[file] = encode_webp_plane(out);
  }

  void means() {
    for (std::size_t file = 0; file < 2; ++file)
      plane(file, [&](std::uint8_t* texel, std::size_t k) {
        for (std::size_t axis = 0; axis < 3; ++axis)
          texel[axis] = static_cast<std::uint8_t>(range_.step(axis, g_.means[3 * k + axis]) >> 8 * file & 255);
      });
  }

  void scales() {
    Channels logarithms(g_.scales.size());
    std::transform(g_.scales.begin(), g_.scales.end(), logarithms.begin(), [](float s) {
      return static_cast<float>(s > 0 ? std::log(static_cast<double>(s)) : kLogarithmOfZero);
    });
    const Codebook codebook(logarithms);
    scale_codebook_ = codebook.values();
    plane(2, [&](std::uint8_t* texel, std::size_t k) {
      for (std::size_t i = 0; i < 3; ++i) texel[i] = codebook.nearest(logarithms[3 * k + i]);
    });
  }

  void rotations() {
    plane(3, [&](std::uint8_t* texel, std::size_t k) {
      const UnitQuaternion q(&g_.quats[4 * k]);
      const auto* largest =
          std::max_element(q.at, q.at + 4, [](double a, double b) { return std::abs(a) < std::abs(b); });
      const double sign = *largest < 0 ? -1 : 1;
      std::size_t to = 0;
      for (const double& v : q.at)
        if (&v != largest) texel[to++] = to_byte((sign * v * std::sqrt(2.0) / 2 + 0.5) * 255);
      texel[3] = static_cast<std::uint8_t>(252 + (largest - q.at));
    });
  }

  void colours() {
    Channels numbers(3 * g_.count);
    for (std::size_t k = 0; k < g_.count; ++k) std::copy_n(&g_.sh[3 * k * sh_count_], 3, &numbers[3 * k]);
    const Codebook codebook(numbers);
    colour_codebook_ = codebook.values();
    plane(4, [&](std::uint8_t* texel, std::size_t k) {
      for (std::size_t c = 0; c < 3; ++c) texel[c] = codebook.nearest(numbers[3 * k + c]);
      texel[3] = to_byte(g_.opacities[k] * 255.0);
    });
  }

  // Makes the palette, on all threads, and adds the jobs that write it.
  void harmonics(std::size_t coefficients) {
    Channels vectors(3 * coefficients * g_.count);
    for (std::size_t i = 0; i < g_.count; ++i)
      std::copy_n(&g_.sh[3 * (order_[i] * sh_count_ + 1)], 3 * coefficients, &vectors[3 * coefficients * i]);
    palette_ = make_sh_palette(std::move(vectors), 3 * coefficients, sh_palette_size(g_.count));
    meta_["shN"]["count"] = palette_.size();
    jobs_.emplace_back([this, coefficients] { write_centroids(coefficients); });
    jobs_.emplace_back([this] { write_labels(); });
  }

  void write_centroids(std::size_t coefficients) {
    const Codebook codebook(palette_.centroids);
    sh_codebook_ = codebook.values();
    WebpPlane out;
    out.width = static_cast<int>(kPaletteRow * coefficients);
    out.height = static_cast<int>((palette_.size() + kPaletteRow - 1) / kPaletteRow);
    out.rgba.assign(4 * out.texels(), 0);
    for (std::size_t i = 0; i < palette_.centroids.size(); ++i)
      out.rgba[i / 3 * 4 + i % 3] = codebook.nearest(palette_.centroids[i]);
    for (std::size_t i = 3; i < out.rgba.size(); i += 4) out.rgba[i] = 255;
    bytes_[5] = encode_webp_plane(out);
  }

  void write_labels() {
    WebpPlane out;
    out.width = width_;
    out.height = height_;
    out.rgba.resize(4 * out.texels());
    for (std::size_t i = 0; i < g_.count; ++i) {
      out.rgba[4 * i] = static_cast<std::uint8_t>(palette_.labels[i] & 255);
      out.rgba[4 * i + 1] = static_cast<std::uint8_t>(palette_.labels[i] >> 8);
      out.rgba[4 * i + 3] = 255;
    }
    bytes_[6] = encode_webp_plane(out);
  }

  const Gaussians& g_;
  PositionRange range_;
  std::size_t sh_count_;
  int width_ = 0, height_ = 0;
  std::vector<std::uint32_t> order_;  // the Gaussian of each texel
  ShPalette palette_;                 // its labels are in this order, too
  std::array<float, 256> scale_codebook_{}, colour_codebook_{}, sh_codebook_{};
  json meta_;
  std::vector<std::string> names_;
  std::vector<std::vector<unsigned char>> bytes_;  // by name
  std::vector<std::function<void()>> jobs_;
};

}  // namespace

void write_sog(const std::string& path, const Scene& scene) {
  Gaussians made;
  const Gaussians& g = volumes_to_write(path, scene.gaussians, made);
  if (g.count > kMostWritten)
    fail(Status::input, "{}: {} Gaussians: a SOG file holds at most {}", path, g.count, kMostWritten);
  SogPlanes planes(g);
  // The format's description has the flag, the programs that play such files the model's name.
  if (scene.antialias) planes.meta()["antialias"] = true, planes.meta()["model"] = "antialiased";
  planes.meta()["vsplat"] = notes_of(scene);
  const std::string meta = planes.meta().dump();
  std::vector<NamedBytes> files = planes.take();
  files.insert(files.begin(), {"meta.json", {meta.begin(), meta.end()}});
  const std::vector<unsigned char> archive = make_zip(files);
  OutputFile file(path);
  file.write(archive.data(), archive.size());
  file.commit();
}

std::vector<std::string> sog_rounding(const Scene& scene) {
  const Gaussians& g = scene.gaussians;
  if (g.count == 0) return {};
  const PositionRange range(g);
  double step = 0;
  for (std::size_t i = 0; i < 3; ++i)
    step = std::max(step, (range.maxs[i] - range.mins[i]) / 65535 *
                              std::exp(std::max(std::abs(range.mins[i]), std::abs(range.maxs[i]))));
  std::vector<std::string> out = {fmt::format("positions are rounded to at most {:.2g}, least about the origin", step),
                                  "scales and colours are rounded to 256 values each",
                                  "opacities are rounded to 1/255 and rotations to 1/180"};
  if (g.sh_degree > 0)
    out.push_back(
        fmt::format("the view-dependent colours of {} Gaussians share {} vectors", g.count, sh_palette_size(g.count)));
  return out;
}

}  // namespace vsplat
