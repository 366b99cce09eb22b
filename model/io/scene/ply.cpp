#include "model/io/scene/ply.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "model/base/statistics.h"
#include "model/io/scene/compressed_ply.h"
#include "model/io/scene/ply_comments.h"
#include "model/io/scene/ply_rows.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/message_text.h"

namespace vsplat {
namespace {

constexpr std::size_t kMostShCount = 25;

// The properties that make up a Gaussian, in this order: x y z, three colours, f_rest_* with the channel innermost,
// then the groups that the file has, beginning at `opacity`, `scales` and `quats`.
struct Layout {
  std::vector<const PlyProperty*> columns;
  std::optional<std::size_t> opacity, scales, quats;
  GaussianKind kind = GaussianKind::volume;
  bool is_round = false;  // one scale for all axes
  bool is_rgb = false;
  int degree = 0;

  std::size_t sh_count() const { return static_cast<std::size_t>(degree + 1) * (degree + 1); }
  // An opacity in 8 or 16 bits is no logit.
  bool has_opacity_share() const {
    return opacity && (columns[*opacity]->type == PlyType::u8 || columns[*opacity]->type == PlyType::u16);
  }
};

// Appends the properties with these names. Returns their first column, or nothing if the file has none of them; a
// partial group is an error.
std::optional<std::size_t> add_group(const std::string& path, const PlyElement& vertex, Layout& layout,
                                     const std::vector<std::string>& names) {
  const std::size_t begin = layout.columns.size();
  const std::string* missing = nullptr;
  for (const std::string& name : names) {
    if (const PlyProperty* p = vertex.find(name)) {
      layout.columns.push_back(p);
    } else if (!missing) {
      missing = &name;
    }
  }
  if (layout.columns.size() == begin) return std::nullopt;
  if (missing) fail(Status::format, "{}: element vertex has no property {}", path, *missing);
  return begin;
}

// f_rest_* are stored channel by channel.
void add_rest(const std::string& path, const PlyElement& vertex, Layout& layout) {
  std::size_t n = 0;
  for (const PlyProperty& p : vertex.properties) n += p.name.rfind("f_rest_", 0) == 0;
  if (n != 0 && n != 9 && n != 24 && n != 45 && n != 72)
    fail(Status::format, "{}: {} properties f_rest_*: 0, 9, 24, 45 or 72 are expected (SH degree 0 to 4)", path, n);
  layout.degree = n == 0 ? 0 : n == 9 ? 1 : n == 24 ? 2 : n == 45 ? 3 : 4;
  std::vector<std::string> names;
  for (std::size_t i = 0; i + 1 < layout.sh_count(); ++i)
    for (std::size_t c = 0; c < 3; ++c) names.push_back(fmt::format("f_rest_{}", c * (n / 3) + i));
  if (n != 0 && !add_group(path, vertex, layout, names))
    fail(Status::format, "{}: element vertex has no property f_rest_0", path);
}

Layout find_columns(const std::string& path, const PlyElement& vertex) {
  Layout out;
  if (!add_group(path, vertex, out, {"x", "y", "z"}))
    fail(Status::format, "{}: element vertex has no property x", path);
  if (!add_group(path, vertex, out, {"f_dc_0", "f_dc_1", "f_dc_2"})) {
    out.is_rgb = add_group(path, vertex, out, {"red", "green", "blue"}).has_value();
    if (!out.is_rgb)
      fail(Status::format,
           "{}: element vertex has neither f_dc_0, f_dc_1, f_dc_2 nor red, green, blue: a mesh or points without "
           "colours, no 3DGS file",
           path);
  }
  add_rest(path, vertex, out);
  out.opacity = add_group(path, vertex, out, {"opacity"});
  // A missing scale_2 identifies surfels, also in 2DGS files.
  if (vertex.find("scale_0") && vertex.find("scale_1") && !vertex.find("scale_2")) out.kind = GaussianKind::surfel;
  out.is_round = vertex.find("scale_0") && !vertex.find("scale_1") && !vertex.find("scale_2");
  std::vector<std::string> scales;
  const int num_scales = out.is_round ? 1 : scales_of(out.kind);
  scales.reserve(static_cast<std::size_t>(num_scales));
  for (int i = 0; i < num_scales; ++i) scales.push_back(fmt::format("scale_{}", i));
  out.scales = add_group(path, vertex, out, scales);
  out.quats = add_group(path, vertex, out, {"rot_0", "rot_1", "rot_2", "rot_3"});
  return out;
}

// Warns of groups that the file lacks, and names the properties that are not read: they may hold them by other names.
void look_at_absent(const std::string& path, const PlyElement& vertex, const Layout& layout) {
  std::vector<std::string> absent;
  if (!layout.opacity) absent.emplace_back("without opacity, each Gaussian is half opaque");
  if (!layout.scales)
    absent.emplace_back("without scale_*, each is a ball with a standard deviation of 0.018");
  else if (!layout.quats && !layout.is_round)
    absent.emplace_back("without rot_*, none is turned");
  if (absent.empty()) return;
  std::vector<std::string> others;
  for (const PlyProperty& p : vertex.properties) {
    const bool is_known = p.name == "nx" || p.name == "ny" || p.name == "nz" ||
                          std::find(layout.columns.begin(), layout.columns.end(), &p) != layout.columns.end();
    if (!is_known) others.push_back(p.name);
  }
  constexpr std::size_t shown = 8;
  std::string unread;
  if (!others.empty())
    unread =
        fmt::format("; not read: {}", fmt::join(others.begin(), others.begin() + std::min(others.size(), shown), ", "));
  if (others.size() > shown) unread += fmt::format(" and {} more", others.size() - shown);
  warn("{}: {}{}", path, fmt::join(absent, ", "), unread);
}

double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

// The value that stands for 1 in colours of this type.
double colour_range(PlyType type) {
  switch (type) {
    case PlyType::u8:
      return 255;
    case PlyType::u16:
      return 65535;
    default:
      return 1;
  }
}

struct Gaussian {
  float mean[3], scale[3], quat[4], opacity, sh[3 * kMostShCount];
};

// The reason why a Gaussian cannot be drawn, and the column that causes it.
struct Defect {
  GaussianDefect kind = GaussianDefect::none;
  std::size_t column = 0;
};

bool fits(double v) { return std::abs(v) <= std::numeric_limits<float>::max(); }  // false for NaN

Defect not_finite(const float* values, std::size_t begin, std::size_t count) {
  bool good = true;
  for (std::size_t i = begin; i < begin + count; ++i) good &= fits(values[i]);
  if (good) return {};
  std::size_t i = begin;
  while (fits(values[i])) ++i;
  return {GaussianDefect::not_finite, i};
}

// Converts the columns' values to a Gaussian.
Defect decode(const Layout& layout, const float* values, Gaussian& out) {
  const std::size_t plain = 3 + 3 * layout.sh_count();
  if (const Defect d = not_finite(values, 0, plain); d.kind != GaussianDefect::none) return d;
  std::copy_n(values, 3, out.mean);
  std::copy_n(values + 3, plain - 3, out.sh);
  for (std::size_t i = 3; layout.is_rgb && i < 6; ++i) {
    const double sh = (values[i] / colour_range(layout.columns[i]->type) - 0.5) / kShC0;
    if (!fits(sh)) return {GaussianDefect::not_finite, i};
    out.sh[i - 3] = static_cast<float>(sh);
  }

  const float opacity = layout.opacity ? values[*layout.opacity] : 0;
  if (std::isnan(opacity)) return {GaussianDefect::not_finite, *layout.opacity};
  out.opacity = static_cast<float>(layout.has_opacity_share() ? static_cast<double>(opacity) /
                                                                    colour_range(layout.columns[*layout.opacity]->type)
                                                              : sigmoid(static_cast<double>(opacity)));

  std::fill_n(out.scale, 3, std::exp(-4.0f));
  if (layout.scales) {
    const std::size_t begin = *layout.scales;
    const std::size_t scales = layout.is_round ? 1 : static_cast<std::size_t>(scales_of(layout.kind));
    for (std::size_t i = 0; i < scales; ++i) {
      const float logarithm = values[begin + i];
      if (std::isnan(logarithm) || logarithm == std::numeric_limits<float>::infinity())
        return {GaussianDefect::not_finite, begin + i};
      const double scale = std::exp(static_cast<double>(logarithm));
      if (!fits(scale)) return {GaussianDefect::huge_scale, begin + i};
      out.scale[i] = static_cast<float>(scale);
      // Flat in that direction: use the smallest normal float, whose logarithm is finite.
      if (std::isinf(logarithm)) out.scale[i] = std::numeric_limits<float>::min();
    }
    if (layout.is_round) out.scale[1] = out.scale[2] = out.scale[0];
  }

  std::copy_n(std::array{1.0f, 0.0f, 0.0f, 0.0f}.data(), 4, out.quat);
  if (layout.quats) {
    const std::size_t begin = *layout.quats;
    if (const Defect d = not_finite(values, begin, 4); d.kind != GaussianDefect::none) return d;
    double norm = 0;
    for (std::size_t i = 0; i < 4; ++i) norm += static_cast<double>(values[begin + i]) * values[begin + i];
    if (!(norm > 0)) return {GaussianDefect::zero_rotation, begin};
    norm = std::sqrt(norm);
    for (std::size_t i = 0; i < 4; ++i) out.quat[i] = static_cast<float>(values[begin + i] / norm);
  }
  return {};
}

// "Gaussian 3, rot_0 (byte 1234): ..."
std::string describe(const Defect& defect, const Layout& layout, const PlyRows& rows, std::uint64_t k) {
  const double found = rows.value(defect.column);
  std::string what;
  switch (defect.kind) {
    case GaussianDefect::huge_scale:
      what = fmt::format("{}, a scale's logarithm, is beyond what a float holds: at most 88.7 is expected",
                         number_text(found));
      break;
    case GaussianDefect::zero_rotation:
      what = "the quaternion rot_0 to rot_3 is zero, any other length is expected";
      break;
    default:
      what = fmt::format("{}, a finite number{} is expected", number_text(found),
                         std::isfinite(found) ? " in a float's range" : "");
  }
  return fmt::format("Gaussian {}, {} (byte {}): {}", k, layout.columns[defect.column]->name,
                     rows.byte_of(defect.column), what);
}

void append(Gaussians& g, const Gaussian& one) {
  const auto add = [](std::vector<float>& to, const float* from, std::size_t n) {
    to.insert(to.end(), from, from + n);
  };
  add(g.means, one.mean, 3);
  add(g.scales, one.scale, static_cast<std::size_t>(scales_of(g.kind)));
  add(g.quats, one.quat, 4);
  g.opacities.push_back(one.opacity);
  add(g.sh, one.sh, 3 * g.sh_count());
  ++g.count;
}

Gaussians read_gaussians(const std::string& path, const Layout& layout, std::uint64_t count, PlyRows& rows,
                         SkippedGaussians* skipped) {
  Gaussians g;
  g.sh_degree = layout.degree;
  g.kind = layout.kind;
  const auto size = static_cast<std::size_t>(count);
  g.means.reserve(3 * size);
  g.scales.reserve(static_cast<std::size_t>(scales_of(g.kind)) * size);
  g.quats.reserve(4 * size);
  g.opacities.reserve(size);
  g.sh.reserve(3 * size * g.sh_count());
  std::vector<float> values(layout.columns.size());
  Gaussian one{};
  GaussianSkips skips(path, skipped);
  for (std::uint64_t k = 0; k < count; ++k) {
    rows.next(values.data());
    const Defect defect = decode(layout, values.data(), one);
    if (defect.kind == GaussianDefect::none) {
      append(g, one);
      continue;
    }
    skips.add(defect.kind, [&] { return describe(defect, layout, rows, k); });
  }
  skips.report(count);
  return g;
}

// Detects float colours in 0 to 255 (or 65535) and rescales them.
void look_at_colours(const std::string& path, const Layout& layout, Gaussians& g) {
  if (!layout.is_rgb || colour_range(layout.columns[3]->type) != 1) return;
  const auto colour = [](float sh) { return 0.5 + kShC0 * static_cast<double>(sh); };
  double most = 0;
  const std::size_t each = 3 * g.sh_count();
  for (std::size_t k = 0; k < g.count; ++k)
    for (std::size_t c = 0; c < 3; ++c) most = std::max(most, colour(g.sh[each * k + c]));
  if (most <= 1.5) return;
  const double range = most <= 256 ? 255 : 65535;
  for (std::size_t k = 0; k < g.count; ++k)
    for (std::size_t c = 0; c < 3; ++c) {
      float& sh = g.sh[each * k + c];
      sh = static_cast<float>((colour(sh) / range - 0.5) / kShC0);
    }
  warn("{}: red, green and blue go up to {:.4g}: they are read as 0 to {}, not as 0 to 1", path, most, range);
}

// Warns if opacities or scales look like final values instead of logits and logarithms.
void look_at_activated(const std::string& path, const Layout& layout, const Gaussians& g) {
  constexpr std::size_t least = 10;  // fewer are not conclusive
  if (g.count < least) return;
  if (layout.opacity && !layout.has_opacity_share()) {
    const auto [low, high] = std::minmax_element(g.opacities.begin(), g.opacities.end());
    // sigmoid(0) to sigmoid(1)
    if (*low >= 0.5f && *high <= 0.7311f && *high - *low > 0.01f)
      warn(
          "{}: every opacity is between 0 and 1, as if it were the opacity itself: in this format it is the logit "
          "log(p / (1 - p)). They are drawn as logits, {:.2g} to {:.2g} opaque; if that is wrong, write logits",
          path, *low, *high);
  }
  if (!layout.scales) return;
  const auto least_scale = *std::min_element(g.scales.begin(), g.scales.end());
  if (least_scale < 1) return;  // a logarithm below 0
  double extent = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (std::size_t k = 0; k < g.count; ++k) values.push_back(g.means[3 * k + axis]);
    extent = std::max(extent, quantile(values, 0.95) - quantile(values, 0.05));
  }
  if (static_cast<double>(least_scale) > 0.25 * extent)
    warn(
        "{}: every scale is above 0, as if it were the size itself: in this format it is the size's logarithm. Read "
        "so, "
        "each Gaussian is larger than a quarter of the scene; if that is wrong, write logarithms",
        path);
}

Scene read_any_ply(PlyFile& in, SkippedGaussians* skipped) {
  const std::string& path = in.path();
  const PlyHeader header = read_ply_header(in);
  const auto vertex = std::find_if(header.elements.begin(), header.elements.end(),
                                   [](const PlyElement& e) { return e.name == "vertex"; });
  if (vertex == header.elements.end()) fail(Status::format, "{}: no element vertex: no 3DGS file", path);
  if (is_compressed_ply(header)) return read_compressed_ply(in, header, skipped);
  const Layout layout = find_columns(path, *vertex);
  look_at_absent(path, *vertex, layout);
  const std::unique_ptr<PlyRows> rows = PlyRows::open(in, header, *vertex, layout.columns);
  Scene scene;
  read_comments(path, header, layout.kind, scene);
  scene.gaussians = read_gaussians(path, layout, vertex->count, *rows, skipped);
  look_at_colours(path, layout, scene.gaussians);
  look_at_activated(path, layout, scene.gaussians);
  return scene;
}

}  // namespace

Scene read_ply(const std::string& path, SkippedGaussians* skipped) {
  PlyFile in(path);
  return read_any_ply(in, skipped);
}

Scene read_ply(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped) {
  PlyFile in(name, content);
  return read_any_ply(in, skipped);
}

}  // namespace vsplat
