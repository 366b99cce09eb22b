#include "model/io/ply.h"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <sstream>
#include <vector>

#include "model/io/ply_header.h"
#include "runtime/error.h"
#include "runtime/log.h"
#include "runtime/output_file.h"

namespace vsplat {
namespace {

constexpr double kC0 = 0.28209479177387814;
constexpr std::size_t kRows = 4096;  // Gaussians in memory at a time, beside the scene
constexpr std::size_t kMaxHeader = std::size_t{1} << 20;
// Their sigmoid (exponential) is 0 or 1 (0) in float arithmetic, yet every reader takes them.
constexpr float kLogitOfOne = 40, kLogitOfZero = -110, kLogOfZero = -110;

struct Closer {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

// A file read from front to back, with its size known.
class Input {
 public:
  explicit Input(const std::string& path) : path_(path) {
    std::error_code problem;
    if (std::filesystem::is_directory(path, problem))
      fail(Status::file, "{}: is a folder, a PLY file is expected", path);
    file_.reset(std::fopen(path.c_str(), "rb"));
    if (!file_) fail(Status::file, "{}: cannot be opened: {}", path, std::strerror(errno));
    size_ = std::filesystem::file_size(path, problem);
    if (problem) fail(Status::file, "{}: its size cannot be told: {}", path, problem.message());
  }

  std::uint64_t size() const { return size_; }
  // Fewer bytes than asked for at the end of the file only.
  std::size_t read(void* to, std::size_t bytes) {
    const std::size_t n = std::fread(to, 1, bytes, file_.get());
    if (n < bytes && std::ferror(file_.get()))
      fail(Status::file, "{}: cannot be read: {}", path_, std::strerror(errno));
    return n;
  }
  void seek(std::uint64_t to) {
    if (fseeko(file_.get(), static_cast<off_t>(to), SEEK_SET) != 0)
      fail(Status::file, "{}: cannot be read at byte {}: {}", path_, to, std::strerror(errno));
  }

 private:
  std::string path_;
  std::unique_ptr<std::FILE, Closer> file_;
  std::uint64_t size_ = 0;
};

PlyHeader read_header(const std::string& path, Input& in) {
  std::string text(static_cast<std::size_t>(std::min<std::uint64_t>(in.size(), kMaxHeader)), '\0');
  text.resize(in.read(text.data(), text.size()));
  return parse_ply_header(path, text);
}

// Where the vertices begin. Everything the header promises must be there, before anything is made for it.
std::uint64_t find_vertices(const std::string& path, const PlyHeader& header, const PlyElement& vertex,
                            std::uint64_t size) {
  std::uint64_t at = header.size, begin = 0;
  for (const PlyElement& e : header.elements) {
    const bool is_vertex = &e == &vertex;
    if (is_vertex) begin = at;
    if (e.has_list) {
      if (is_vertex) fail(Status::format, "{}: element vertex has a list: no 3DGS file", path);
      if (begin) return begin;  // what follows the vertices is nobody's business
      fail(Status::format, "{}: element {} with a list comes before element vertex: no 3DGS file", path, e.name);
    }
    if (e.stride != 0 && e.count > (size - at) / e.stride)
      fail(Status::format,
           "{}: element {}: the header promises {} of {} bytes each from byte {} on, the file has {} bytes: it is cut "
           "off or "
           "damaged",
           path, e.name, e.count, e.stride, at, size);
    at += e.count * e.stride;
  }
  if (at < size) warn("{}: {} bytes after the last element are ignored (from byte {} on)", path, size - at, at);
  return begin;
}

// One value of every vertex, and where it goes.
class Column {
 public:
  Column(const std::string& path, const PlyElement& vertex, const std::string& name)
      : path_(&path), property_(vertex.find(name)), name_(name) {}

  bool there() const { return property_ != nullptr; }
  const std::string& name() const { return name_; }
  PlyType type() const { return property_->type; }
  double value(const unsigned char* row) const { return ply_value(property_->type, row + property_->offset); }
  [[noreturn]] void bad(std::uint64_t k, std::uint64_t row_at, const std::string& what) const {
    fail(Status::format, "{}: Gaussian {}, {} (byte {}): {}", *path_, k, name_, row_at + property_->offset, what);
  }
  double finite(const unsigned char* row, std::uint64_t k, std::uint64_t row_at) const {
    const double v = value(row);
    if (!std::isfinite(static_cast<float>(v))) bad(k, row_at, fmt::format("{}, a finite number is expected", v));
    return v;
  }

 private:
  const std::string* path_;
  const PlyProperty* property_;
  std::string name_;
};

// `count` properties called prefix + 0, 1, ...: all, or none (an empty list).
std::vector<Column> group(const std::string& path, const PlyElement& vertex, const std::vector<std::string>& names) {
  std::vector<Column> out;
  std::size_t there = 0;
  std::string missing;
  for (const std::string& name : names) {
    out.emplace_back(path, vertex, name);
    if (out.back().there()) {
      ++there;
    } else if (missing.empty()) {
      missing = name;
    }
  }
  if (there == 0) return {};
  if (there != names.size()) fail(Status::format, "{}: element vertex has no property {}", path, missing);
  return out;
}

struct Layout {
  std::vector<Column> means, dc, rgb, rest, opacity, scales, quats;
  int degree = 0;
  std::size_t per_channel = 0;  // f_rest in the file; more than degree 3 has are skipped
};

std::size_t count_rest(const std::string& path, const PlyElement& vertex) {
  std::size_t n = 0;
  for (const PlyProperty& p : vertex.properties) n += p.name.rfind("f_rest_", 0) == 0;
  if (n != 0 && n != 9 && n != 24 && n != 45 && n != 72)
    fail(Status::format, "{}: {} properties f_rest_*: 0, 9, 24 or 45 are expected (SH degree 0 to 3)", path, n);
  if (n == 72) warn("{}: spherical harmonics of degree 4 are read to degree 3", path);
  return n;
}

Layout find_columns(const std::string& path, const PlyElement& vertex) {
  if (vertex.find("packed_position"))
    fail(Status::format, "{}: a compressed PLY (packed_position): not read; export the standard 3DGS PLY", path);
  Layout out;
  out.means = group(path, vertex, {"x", "y", "z"});
  if (out.means.empty()) fail(Status::format, "{}: element vertex has no property x", path);
  if (vertex.find("scale_0") && vertex.find("scale_1") && !vertex.find("scale_2"))
    fail(Status::format, "{}: no property scale_2: flat Gaussians (2DGS) are not read", path);
  out.scales = group(path, vertex, {"scale_0", "scale_1", "scale_2"});
  out.quats = group(path, vertex, {"rot_0", "rot_1", "rot_2", "rot_3"});
  out.opacity = group(path, vertex, {"opacity"});
  out.dc = group(path, vertex, {"f_dc_0", "f_dc_1", "f_dc_2"});
  if (out.dc.empty()) out.rgb = group(path, vertex, {"red", "green", "blue"});
  if (out.dc.empty() && out.rgb.empty())
    fail(Status::format, "{}: element vertex has neither f_dc_0, f_dc_1, f_dc_2 nor red, green, blue: no 3DGS file",
         path);
  const std::size_t rest = count_rest(path, vertex);
  std::vector<std::string> names;
  for (std::size_t i = 0; i < rest; ++i) names.push_back(fmt::format("f_rest_{}", i));
  if (rest) out.rest = group(path, vertex, names);
  out.per_channel = rest / 3;
  out.degree = rest == 0 ? 0 : rest == 9 ? 1 : rest == 24 ? 2 : 3;
  return out;
}

double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

// What a colour's type can hold is 1.
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

// Appends Gaussian k, whose row begins at byte `at` of the file.
void add_gaussian(Gaussians& g, const Layout& layout, const unsigned char* row, std::uint64_t k, std::uint64_t at) {
  for (const Column& c : layout.means) g.means.push_back(static_cast<float>(c.finite(row, k, at)));
  for (const Column& c : layout.scales) {
    const float scale = static_cast<float>(std::exp(c.finite(row, k, at)));
    if (!std::isfinite(scale)) c.bad(k, at, fmt::format("{}, the logarithm of a scale, is too large", c.value(row)));
    g.scales.push_back(scale);
  }
  if (layout.scales.empty()) g.scales.insert(g.scales.end(), 3, std::exp(-4.0f));

  double q[4] = {1, 0, 0, 0}, norm = 0;
  for (std::size_t i = 0; i < layout.quats.size(); ++i) q[i] = layout.quats[i].finite(row, k, at);
  for (const double v : q) norm += v * v;
  norm = std::sqrt(norm);
  if (!(norm > 0)) layout.quats[0].bad(k, at, "the quaternion rot_0 to rot_3 is zero");
  for (const double v : q) g.quats.push_back(static_cast<float>(v / norm));

  double logit = 0;
  if (!layout.opacity.empty()) logit = layout.opacity[0].value(row);
  if (std::isnan(logit)) layout.opacity[0].bad(k, at, "nan, a number is expected");
  g.opacities.push_back(static_cast<float>(sigmoid(logit)));

  for (const Column& c : layout.dc) g.sh.push_back(static_cast<float>(c.finite(row, k, at)));
  for (const Column& c : layout.rgb)
    g.sh.push_back(static_cast<float>((c.finite(row, k, at) / colour_range(c.type()) - 0.5) / kC0));
  for (std::size_t i = 0; i + 1 < g.sh_count(); ++i)
    for (std::size_t c = 0; c < 3; ++c)
      g.sh.push_back(static_cast<float>(layout.rest[c * layout.per_channel + i].finite(row, k, at)));
}

std::vector<float> comment_floats(const std::string& path, const std::string& comment, std::istringstream& in,
                                  std::size_t count) {
  std::vector<float> out;
  for (std::string word; in >> word;) {
    float v = 0;
    const auto [end, problem] = std::from_chars(word.data(), word.data() + word.size(), v);
    if (problem != std::errc() || end != word.data() + word.size() || !std::isfinite(v)) break;
    out.push_back(v);
  }
  if (out.size() != count || !in.eof())
    fail(Status::format, "{}: comment \"{}\": {} finite number{} expected", path, comment, count,
         count == 1 ? " is" : "s are");
  return out;
}

// The comments that are ours.
void read_comments(const std::string& path, const PlyHeader& header, Scene& scene) {
  for (const std::string& comment : header.comments) {
    std::istringstream in(comment);
    std::string who, what;
    in >> who >> what;
    if (who != "vsplat") continue;
    if (what == "near") {
      scene.near = comment_floats(path, comment, in, 1)[0];
      if (scene.near < 0)
        fail(Status::format, "{}: comment \"{}\": a distance of at least 0 is expected", path, comment);
    } else if (what == "mirror_camera_about") {
      const std::vector<float> p = comment_floats(path, comment, in, 3);
      scene.mirror = {p[0], p[1], p[2]};
    }
  }
}

// "x", "f_rest_12", ... in the order in which they are written.
std::vector<std::string> property_names(std::size_t sh_count) {
  std::vector<std::string> names{"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"};
  for (std::size_t i = 0; i < 3 * (sh_count - 1); ++i) names.push_back(fmt::format("f_rest_{}", i));
  for (const char* name : {"opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    names.emplace_back(name);
  return names;
}

std::string make_header(const Scene& scene, const std::vector<std::string>& names) {
  std::string out = "ply\nformat binary_little_endian 1.0\n";
  out += fmt::format("comment vsplat near {}\n", scene.near);
  if (scene.mirror)
    out += fmt::format("comment vsplat mirror_camera_about {} {} {}\n", (*scene.mirror)[0], (*scene.mirror)[1],
                       (*scene.mirror)[2]);
  out += fmt::format("comment SH degree: {}\n", scene.gaussians.sh_degree);
  out += fmt::format("element vertex {}\n", scene.gaussians.count);
  for (const std::string& name : names) out += "property float " + name + "\n";
  return out + "end_header\n";
}

float logit(float opacity) {
  if (opacity >= 1) return kLogitOfOne;
  if (opacity <= 0) return kLogitOfZero;
  const double o = opacity;
  return static_cast<float>(std::log(o) - std::log1p(-o));
}

// One row, in the order of property_names().
void put_row(const Gaussians& g, std::size_t k, float* out) {
  const float* mean = &g.means[3 * k];
  const float* sh = &g.sh[3 * k * g.sh_count()];
  const float* q = &g.quats[4 * k];
  for (int i = 0; i < 3; ++i) *out++ = mean[i];
  for (int i = 0; i < 3; ++i) *out++ = 0;  // some viewers expect normals
  for (int i = 0; i < 3; ++i) *out++ = sh[i];
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t i = 1; i < g.sh_count(); ++i) *out++ = sh[3 * i + c];
  *out++ = std::isnan(g.opacities[k]) ? g.opacities[k] : logit(g.opacities[k]);
  for (std::size_t i = 0; i < 3; ++i) {
    const float s = g.scales[3 * k + i];
    *out++ = s > 0 ? static_cast<float>(std::log(static_cast<double>(s))) : s == 0 ? kLogOfZero : std::nanf("");
  }
  double norm = 0;
  for (int i = 0; i < 4; ++i) norm += static_cast<double>(q[i]) * q[i];
  norm = std::sqrt(norm);
  for (int i = 0; i < 4; ++i) *out++ = norm == 0 ? (i == 0 ? 1.0f : 0.0f) : static_cast<float>(q[i] / norm);
}

}  // namespace

Scene read_ply(const std::string& path) {
  Input in(path);
  const PlyHeader header = read_header(path, in);
  const PlyElement* vertex = nullptr;
  for (const PlyElement& e : header.elements)
    if (e.name == "vertex" && !vertex) vertex = &e;
  if (!vertex) fail(Status::format, "{}: no element vertex: no 3DGS file", path);
  const Layout layout = find_columns(path, *vertex);
  std::uint64_t at = find_vertices(path, header, *vertex, in.size());

  Scene scene;
  read_comments(path, header, scene);
  Gaussians& g = scene.gaussians;
  g.count = static_cast<std::size_t>(vertex->count);
  g.sh_degree = layout.degree;
  g.means.reserve(3 * g.count);
  g.scales.reserve(3 * g.count);
  g.quats.reserve(4 * g.count);
  g.opacities.reserve(g.count);
  g.sh.reserve(3 * g.count * g.sh_count());
  in.seek(at);
  std::vector<unsigned char> rows(std::min(kRows, g.count) * vertex->stride);
  for (std::size_t first = 0; first < g.count; first += kRows) {
    const std::size_t count = std::min(kRows, g.count - first);
    if (in.read(rows.data(), count * vertex->stride) != count * vertex->stride)
      fail(Status::format, "{}: ends within the Gaussians from {} on (byte {})", path, first, at);
    for (std::size_t i = 0; i < count; ++i, at += vertex->stride)
      add_gaussian(g, layout, &rows[i * vertex->stride], first + i, at);
  }
  return scene;
}

void write_ply(const std::string& path, const Scene& scene) {
  const Gaussians& g = scene.gaussians;
  const std::vector<std::string> names = property_names(g.sh_count());
  const std::string header = make_header(scene, names);
  OutputFile file(path);
  file.write(header);
  const std::size_t width = names.size();
  std::vector<float> rows(std::min(kRows, g.count) * width);
  for (std::size_t first = 0; first < g.count; first += kRows) {
    const std::size_t count = std::min(kRows, g.count - first);
    for (std::size_t i = 0; i < count; ++i) put_row(g, first + i, &rows[i * width]);
    for (std::size_t i = 0; i < count * width; ++i)
      if (!std::isfinite(rows[i]))
        fail(Status::input, "{}: Gaussian {}: its {} would be {}: nothing is written", path, first + i / width,
             names[i % width], rows[i]);
    file.write(rows.data(), count * width * sizeof(float));
  }
  file.commit();
}

}  // namespace vsplat
