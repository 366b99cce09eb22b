#include "model/io/scene/compressed_ply.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>

#include "model/io/scene/ply_comments.h"
#include "model/io/scene/ply_rows.h"
#include "runtime/fail.h"
#include "runtime/message_text.h"

namespace vsplat {
namespace {

using namespace compressed_ply;

const PlyProperty& property_of(const std::string& path, const PlyElement& element, const std::string& name) {
  const PlyProperty* out = element.find(name);
  if (!out) fail(Status::format, "{}: element {} has no property {}", path, element.name, name);
  return *out;
}

const PlyElement* element_of(const PlyHeader& header, const std::string& name) {
  const auto found =
      std::find_if(header.elements.begin(), header.elements.end(), [&](const PlyElement& e) { return e.name == name; });
  return found == header.elements.end() ? nullptr : &*found;
}

struct Bounds {
  std::array<float, kNumBounds> values{};
  std::size_t bad = kNumBounds;  // the first value that is not finite
  std::uint64_t bad_byte = 0;
};

std::vector<Bounds> read_bounds(PlyFile& in, const PlyHeader& header, std::uint64_t gaussians) {
  const PlyElement* chunks = element_of(header, "chunk");
  if (!chunks) fail(Status::format, "{}: a compressed PLY (packed_position) without an element chunk", in.path());
  if (chunks->count != (gaussians + kBlockSize - 1) / kBlockSize)
    fail(Status::format, "{}: element chunk: {} of them, {} Gaussians need {}", in.path(), chunks->count, gaussians,
         (gaussians + kBlockSize - 1) / kBlockSize);
  const bool has_colours = chunks->find("min_r") != nullptr;
  std::vector<const PlyProperty*> wanted;
  for (std::size_t i = 0; i < (has_colours ? kNumBounds : 12); ++i)
    wanted.push_back(&property_of(in.path(), *chunks, kBounds[i]));
  const std::unique_ptr<PlyRows> rows = PlyRows::open(in, header, *chunks, wanted, false);
  std::vector<Bounds> out(static_cast<std::size_t>(chunks->count));
  for (Bounds& each : out) {
    std::fill_n(each.values.begin() + 15, 3, 1.0f);  // colours from 0 to 1
    rows->next(each.values.data());
    for (std::size_t i = 0; i < wanted.size() && each.bad == kNumBounds; ++i)
      if (!std::isfinite(each.values[i])) {
        each.bad = i;
        each.bad_byte = rows->byte_of(i);
      }
  }
  return out;
}

// A share of 0 to 1 in the lowest bits.
double share(std::uint32_t packed, int bits) {
  const std::uint32_t most = (1u << bits) - 1;
  return static_cast<double>(packed & most) / most;
}

std::array<double, 3> shares_11_10_11(std::uint32_t packed) {
  return {share(packed >> 21, 11), share(packed >> 11, 10), share(packed, 11)};
}

// `first` of the lowest bounds, and as many highest ones after them.
double between(const Bounds& bounds, std::size_t first, std::size_t axis, double share) {
  return bounds.values[first + axis] * (1 - share) + bounds.values[first + 3 + axis] * share;
}

std::array<float, 4> rotation_of(std::uint32_t packed) {
  const std::size_t largest = packed >> 30;
  std::array<double, 4> q{};
  double rest = 1;
  int shift = 20;
  for (std::size_t i = 0; i < 4; ++i) {
    if (i == largest) continue;
    q[i] = (share(packed >> shift, 10) - 0.5) * std::sqrt(2.0);
    rest -= q[i] * q[i];
    shift -= 10;
  }
  q[largest] = std::sqrt(std::max(0.0, rest));
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  std::array<float, 4> out{};
  for (std::size_t i = 0; i < 4; ++i) out[i] = static_cast<float>(q[i] / length);
  return out;
}

// Appends a Gaussian, or returns why it cannot be drawn.
GaussianDefect append(const Bounds& bounds, const std::array<std::uint32_t, 4>& packed, Gaussians& g) {
  if (bounds.bad != kNumBounds) return GaussianDefect::not_finite;
  const std::array<double, 3> at = shares_11_10_11(packed[0]), sizes = shares_11_10_11(packed[2]);
  std::array<float, 3> scales{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double scale = std::exp(between(bounds, 6, c, sizes[c]));
    if (!(scale <= std::numeric_limits<float>::max())) return GaussianDefect::huge_scale;
    scales[c] = static_cast<float>(scale);
  }
  for (std::size_t c = 0; c < 3; ++c) g.means.push_back(static_cast<float>(between(bounds, 0, c, at[c])));
  g.scales.insert(g.scales.end(), scales.begin(), scales.end());
  const std::array<float, 4> q = rotation_of(packed[1]);
  g.quats.insert(g.quats.end(), q.begin(), q.end());
  for (std::size_t c = 0; c < 3; ++c) {
    const double colour = between(bounds, 12, c, share(packed[3] >> (24 - 8 * c), 8));
    const double limit = std::numeric_limits<float>::max();
    g.sh.push_back(static_cast<float>(std::clamp((colour - 0.5) / kShC0, -limit, limit)));
  }
  g.opacities.push_back(static_cast<float>(share(packed[3], 8)));
  g.sh.resize(g.sh.size() + 3 * (g.sh_count() - 1));
  ++g.count;
  return GaussianDefect::none;
}

int degree_of(const std::string& path, const PlyElement* sh, std::uint64_t gaussians) {
  if (!sh) return 0;
  if (sh->count != gaussians)
    fail(Status::format, "{}: element sh: {} rows for {} Gaussians", path, sh->count, gaussians);
  std::size_t n = 0;
  for (const PlyProperty& p : sh->properties) n += p.name.rfind("f_rest_", 0) == 0;
  for (const int degree : {1, 2, 3, 4})
    if (n == 3 * (static_cast<std::size_t>(degree + 1) * (degree + 1) - 1)) return degree;
  fail(Status::format, "{}: element sh: {} properties f_rest_*: 9, 24, 45 or 72 are expected (SH degree 1 to 4)", path,
       n);
}

// Reads the bytes of the Gaussians that are not skipped.
void read_sh(PlyFile& in, const PlyHeader& header, const PlyElement& element, const std::vector<bool>& is_skipped,
             Gaussians& g) {
  const std::size_t rest = g.sh_count() - 1;
  std::vector<const PlyProperty*> wanted;
  for (std::size_t i = 0; i < 3 * rest; ++i) {
    wanted.push_back(&property_of(in.path(), element, fmt::format("f_rest_{}", i)));
    if (wanted.back()->type != PlyType::u8)
      fail(Status::format, "{}: element sh: property f_rest_{} is no uchar, which is expected", in.path(), i);
  }
  const std::unique_ptr<PlyRows> rows = PlyRows::open(in, header, element, wanted, false);
  std::vector<float> values(3 * rest);
  std::size_t to = 0;
  for (std::size_t k = 0; k < is_skipped.size(); ++k) {
    rows->next(values.data());
    if (is_skipped[k]) continue;
    float* sh = &g.sh[3 * to++ * g.sh_count()];
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t i = 0; i < rest; ++i) {
        const float byte = values[c * rest + i];
        // The middle of the interval that the byte stands for; the outermost are for the ends.
        const float at = byte == 0 ? 0 : byte == 255 ? 1 : (byte + 0.5f) / 256;
        sh[3 * (i + 1) + c] = (at - 0.5f) * 8;
      }
  }
}

}  // namespace

bool is_compressed_ply(const PlyHeader& header) {
  const PlyElement* vertex = element_of(header, "vertex");
  return vertex && vertex->find(kPacked[0]);
}

Scene read_compressed_ply(PlyFile& in, const PlyHeader& header, SkippedGaussians* skipped) {
  const std::string& path = in.path();
  const PlyElement& vertex = *element_of(header, "vertex");
  const PlyElement* sh = element_of(header, "sh");
  std::vector<const PlyProperty*> wanted;
  for (const char* name : kPacked) {
    wanted.push_back(&property_of(path, vertex, name));
    if (wanted.back()->type != PlyType::u32)
      fail(Status::format, "{}: element vertex: property {} is no uint, which is expected", path, name);
  }
  Scene scene;
  read_comments(path, header, GaussianKind::volume, scene);
  Gaussians& g = scene.gaussians;
  g.sh_degree = degree_of(path, sh, vertex.count);
  PlyRows::open(in, header, vertex, wanted);  // checks that the file holds every element
  const std::vector<Bounds> bounds = read_bounds(in, header, vertex.count);
  const auto count = static_cast<std::size_t>(vertex.count);
  const std::unique_ptr<PlyRows> vertices = PlyRows::open(in, header, vertex, wanted, false);
  std::vector<bool> is_skipped(count);
  GaussianSkips skips(path, skipped);
  std::array<float, 4> ignored{};
  for (std::size_t k = 0; k < count; ++k) {
    vertices->next(ignored.data());
    std::array<std::uint32_t, 4> packed{};
    for (std::size_t i = 0; i < 4; ++i) packed[i] = static_cast<std::uint32_t>(vertices->value(i));
    const Bounds& own = bounds[k / kBlockSize];
    const GaussianDefect defect = append(own, packed, g);
    if (defect == GaussianDefect::none) continue;
    is_skipped[k] = true;
    skips.add(defect, [&] {
      if (defect == GaussianDefect::not_finite)
        return fmt::format("Gaussian {}, {} of its chunk {} (byte {}): {}, a finite number is expected", k,
                           kBounds[own.bad], k / kBlockSize, own.bad_byte, number_text(own.values[own.bad]));
      return fmt::format("Gaussian {}, packed_scale (byte {}): a scale beyond what a float holds", k,
                         vertices->byte_of(2));
    });
  }
  skips.report(vertex.count);
  if (sh) read_sh(in, header, *sh, is_skipped, g);
  return scene;
}

}  // namespace vsplat
