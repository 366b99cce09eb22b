#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <set>
#include <vector>

#include "model/base/scene_edit.h"
#include "model/io/scene/gltf_document.h"
#include "model/io/scene/gltf_splats.h"
#include "model/io/scene/scene_notes.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/log.h"
#include "runtime/message_text.h"
#include "runtime/printable.h"
#include "runtime/system/host_memory.h"

namespace vsplat {
namespace {

constexpr const char* kExtension = "KHR_gaussian_splatting";
constexpr std::size_t kMostCoefficients = 16;
constexpr std::size_t kMostParts = 65536;  // primitives, counted once for each node that shows them

bool is_finite_float(double v) { return std::abs(v) <= std::numeric_limits<float>::max(); }  // false for NaN

std::size_t coefficients(int degree) {
  return static_cast<std::size_t>(degree + 1) * static_cast<std::size_t>(degree + 1);
}

// The inverse of glTF's sRGB curve: COLOR_0 is in linear light.
double srgb_encoded(double v) { return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055; }

// The signs of coefficients under a half turn about z: those of odd order change.
float sign_of(std::size_t coefficient) {
  const auto degree = static_cast<int>(std::sqrt(static_cast<double>(coefficient)));
  const int order = static_cast<int>(coefficient) - degree * degree - degree;
  return order % 2 == 0 ? 1.0f : -1.0f;
}

// A primitive's Gaussians in the file.
struct Splats {
  GltfValue primitive;
  Similarity node;  // from glTF's axes to glTF's axes
  bool moved = false;
  int degree = 0;
  std::size_t count = 0;
};

struct SplatColumns {
  GltfNumbers position, rotation, scale, opacity;
  std::vector<GltfNumbers> sh;  // one for each coefficient
  bool is_colour = false;       // sh[0] is COLOR_0
};

class SplatsReader {
 public:
  SplatsReader(GltfDocument& document, SkippedGaussians* skipped)
      : document_(document), skips_(document.name(), skipped) {}

  Scene read() {
    find();
    if (found_.empty()) {
      const std::string other = other_extension();
      fail(Status::format, "{}: no primitive has the extension {}: {} where Gaussians are expected", document_.name(),
           kExtension,
           other.empty() ? "a mesh, or an empty scene,"
                         : "Gaussians by the extension " + other + ", which is not read,");
    }
    refuse_other_requirements();
    Scene scene;
    Gaussians& g = scene.gaussians;
    std::uint64_t count = 0;
    for (Splats& s : found_) {
      s.count = columns_of(s).position.count;
      s.degree = degree_of(s.primitive);
      g.sh_degree = std::max(g.sh_degree, s.degree);
      count += s.count;
    }
    const std::size_t numbers = 11 + 3 * g.sh_count();
    // A mesh may stand in many nodes: they can be more than the file.
    const double bytes = 4.0 * static_cast<double>(numbers) * static_cast<double>(count);
    const HostMemory reserved(document_.name() + ": its Gaussians", found_.size() > 1 ? 2 * bytes : bytes);
    if (found_.size() == 1) {
      g = read_splats(found_[0], g.sh_degree);
    } else {
      reserve(g, static_cast<std::size_t>(count));
      for (const Splats& s : found_) vsplat::append(g, read_splats(s, g.sh_degree));
    }
    skips_.report(count);
    read_extras(scene);
    return scene;
  }

 private:
  // Walks the nodes of the file's scene; without a scene, all meshes.
  void find() {
    const GltfValue root = document_.root();
    if (!root["scenes"].exists()) {
      for (std::size_t i = 0; i < root["meshes"].size(); ++i) add_mesh(root["meshes"][i], Eigen::Matrix4d::Identity());
      return;
    }
    struct Waiting {
      GltfValue index;
      Eigen::Matrix4d above;
    };
    const std::uint64_t chosen = root["scene"].whole(0);
    const std::size_t scenes = root["scenes"].size();
    if (chosen >= scenes) root["scene"].wrong(fmt::format("is {}: there are {} scenes", chosen, scenes));
    std::vector<Waiting> waiting;
    const auto add = [&](const GltfValue& list, const Eigen::Matrix4d& above) {
      for (std::size_t i = list.size(); i-- > 0;) waiting.push_back({list[i], above});
    };
    add(root["scenes"][static_cast<std::size_t>(chosen)]["nodes"], Eigen::Matrix4d::Identity());
    std::set<std::uint64_t> seen;
    while (!waiting.empty()) {
      const Waiting next = waiting.back();
      waiting.pop_back();
      const GltfValue node = document_.in("nodes", next.index);
      if (!seen.insert(next.index.whole()).second)
        next.index.wrong("is a node that stands elsewhere in the scene, too: a tree is expected");
      const Eigen::Matrix4d world = next.above * matrix_of(node);
      if (node["mesh"].exists()) add_mesh(document_.in("meshes", node["mesh"]), world);
      add(node["children"], world);
    }
  }

  // An older or later extension for Gaussians that the file uses; "" if none.
  std::string other_extension() const {
    const GltfValue used = document_.root()["extensionsUsed"];
    for (std::size_t i = 0; i < used.size(); ++i)
      if (const std::string name = used[i].text(""); name != kExtension && name.find("gaussian_splat") != name.npos)
        return name;
    return "";
  }

  // An extension that the file requires may change what everything else means.
  void refuse_other_requirements() const {
    const GltfValue required = document_.root()["extensionsRequired"];
    for (std::size_t i = 0; i < required.size(); ++i)
      if (const std::string name = required[i].text(""); name != kExtension && name != "KHR_mesh_quantization")
        required[i].wrong("requires the extension " + printable(name) + ", which is not read");
  }

  static Eigen::Matrix4d matrix_of(const GltfValue& node) {
    if (const auto m = node["matrix"].numbers(16); !m.empty()) return Eigen::Map<const Eigen::Matrix4d>(m.data());
    Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
    const auto shift = node["translation"].numbers(3), turn = node["rotation"].numbers(4),
               scale = node["scale"].numbers(3);
    if (!turn.empty()) {
      const Eigen::Quaterniond q(turn[3], turn[0], turn[1], turn[2]);
      if (!(q.norm() > 0)) node["rotation"].wrong("is a quaternion of length 0");
      if (q.vec() != Eigen::Vector3d::Zero()) out.topLeftCorner<3, 3>() = q.normalized().toRotationMatrix();
    }
    for (int i = 0; i < 3 && !scale.empty(); ++i) out.col(i) *= scale[static_cast<std::size_t>(i)];
    for (int i = 0; i < 3 && !shift.empty(); ++i) out(i, 3) = shift[static_cast<std::size_t>(i)];
    return out;
  }

  static Similarity similarity(const GltfValue& mesh, const Eigen::Matrix4d& m) {
    const Eigen::Matrix3d a = m.topLeftCorner<3, 3>();
    const double det = a.determinant();
    bool good = m.allFinite() && det > 0 && std::isfinite(det);
    if (good) {
      const Eigen::Matrix3d r = a / std::cbrt(det);
      good = (r * r.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= 1e-4;
    }
    if (!good)
      mesh.wrong(
          "stands in nodes that do more than rotate, shift and scale evenly: Gaussians allow no other transform");
    return Similarity::from_matrix(m);
  }

  void add_mesh(const GltfValue& mesh, const Eigen::Matrix4d& world) {
    const bool moved = !world.isIdentity(0);
    for (const GltfValue& primitive : parts_of(mesh)) {
      if (found_.size() == kMostParts)
        mesh.wrong(fmt::format("is one too many: at most {} primitives are read, counted for each node", kMostParts));
      found_.push_back({primitive, moved ? similarity(mesh, world) : Similarity(), moved});
    }
  }

  // A mesh's primitives of Gaussians, which are looked for only once.
  const std::vector<GltfValue>& parts_of(const GltfValue& mesh) {
    const auto [known, is_new] = parts_.try_emplace(&mesh.json());
    std::vector<GltfValue>& out = known->second;
    if (!is_new) return out;
    for (std::size_t i = 0; i < mesh["primitives"].size(); ++i) {
      const GltfValue primitive = mesh["primitives"][i], extension = primitive["extensions"][kExtension];
      if (!extension.exists()) continue;
      if (const auto inner = extension["extensions"].names(); !inner.empty())
        extension.wrong(fmt::format("is compressed by {}, which is not read", printable(inner.front())));
      if (const std::uint64_t mode = primitive["mode"].whole(4); mode != 0)
        primitive["mode"].wrong(fmt::format("is {}: 0, points, is expected", mode));
      if (const std::string kernel = extension["kernel"].text("ellipse"); kernel != "ellipse")
        extension["kernel"].wrong(fmt::format("is \"{}\": ellipse is expected", printable(kernel)));
      if (extension["colorSpace"].text("") == "lin_rec709_display")
        warn("{}: {}: colours in linear light are read as they are, as sRGB: they become darker", document_.name(),
             printable(extension.place()));
      out.push_back(primitive);
    }
    return out;
  }

  static GltfValue attribute(const GltfValue& primitive, const std::string& name) {
    return primitive["attributes"][std::string(kExtension) + ":" + name];
  }
  static GltfValue harmonic(const GltfValue& primitive, int degree, int i) {
    return attribute(primitive, fmt::format("SH_DEGREE_{}_COEF_{}", degree, i));
  }

  // The highest degree. Every degree below it is complete.
  static int degree_of(const GltfValue& primitive) {
    int out = 0;
    for (int degree = 1; degree <= 3; ++degree) {
      bool any = false;
      for (int i = 0; i <= 2 * degree; ++i) any |= harmonic(primitive, degree, i).exists();
      if (!any) continue;
      for (int below = out + 1; below <= degree; ++below)
        for (int i = 0; i <= 2 * below; ++i)
          if (!harmonic(primitive, below, i).exists())
            harmonic(primitive, below, i).wrong(fmt::format("is missing: it has coefficients of degree {}", degree));
      out = degree;
    }
    return out;
  }

  GltfNumbers column(const GltfValue& index, std::size_t least, std::size_t most, std::size_t count) {
    if (!index.exists()) index.wrong("is missing");
    GltfNumbers out = document_.numbers(index, least, most);
    if (count && out.count != count) index.wrong(fmt::format("has {} elements: POSITION has {}", out.count, count));
    return out;
  }

  SplatColumns columns_of(const Splats& s) {
    SplatColumns out;
    out.position = column(s.primitive["attributes"]["POSITION"], 3, 3, 0);
    const std::size_t count = out.position.count;
    out.rotation = column(attribute(s.primitive, "ROTATION"), 4, 4, count);
    out.scale = column(attribute(s.primitive, "SCALE"), 3, 3, count);
    out.opacity = column(attribute(s.primitive, "OPACITY"), 1, 1, count);
    const GltfValue colour = s.primitive["attributes"]["COLOR_0"];
    out.is_colour = !harmonic(s.primitive, 0, 0).exists() && colour.exists();
    out.sh.push_back(out.is_colour ? column(colour, 3, 4, count) : column(harmonic(s.primitive, 0, 0), 3, 3, count));
    for (int degree = 1; degree <= s.degree; ++degree)
      for (int i = 0; i <= 2 * degree; ++i) out.sh.push_back(column(harmonic(s.primitive, degree, i), 3, 3, count));
    return out;
  }

  Gaussians read_splats(const Splats& s, int degree) {
    const SplatColumns columns = columns_of(s);
    Gaussians g;
    g.sh_degree = degree;
    g.means.reserve(3 * s.count);
    g.scales.reserve(3 * s.count);
    g.quats.reserve(4 * s.count);
    g.opacities.reserve(s.count);
    g.sh.reserve(3 * g.sh_count() * s.count);
    for (std::size_t k = 0; k < s.count; ++k) add_gaussian(columns, k, g);
    if (!s.moved) return g;
    // The node's transform, seen from the scene's axes.
    const Eigen::Matrix3d turn = Eigen::Vector3d(-1, -1, 1).asDiagonal();
    transform(g, {s.node.scale, turn * s.node.rotation * turn, turn * s.node.translation});
    for (const std::vector<float>* values : {&g.means, &g.scales, &g.sh})
      if (!std::all_of(values->begin(), values->end(), [](float v) { return std::isfinite(v); }))
        s.primitive.wrong("has values beyond a float's range after its nodes' transforms");
    return g;
  }

  // "Gaussian 3, SCALE 0 (accessors[2], element 3): -1, ... is expected", counted or thrown.
  bool bad(GaussianDefect defect, std::size_t k, const char* what, std::size_t i, const GltfNumbers& column,
           const char* expected) {
    skips_.add(defect, [&] {
      return fmt::format("Gaussian {}, {} {} ({}, element {}): {}, {} is expected", k, what, i, column.place, k,
                         number_text(column.at(k, i)), expected);
    });
    return false;
  }

  bool finite(const GltfNumbers& column, std::size_t k, std::size_t count, const char* what, bool positive,
              double* out) {
    for (std::size_t i = 0; i < count; ++i) {
      out[i] = column.at(k, i);
      if (!is_finite_float(out[i]) || (positive && out[i] < 0))
        return bad(GaussianDefect::not_finite, k, what, i, column,
                   positive ? "a finite number from 0 up" : "a finite number");
    }
    return true;
  }

  void add_gaussian(const SplatColumns& from, std::size_t k, Gaussians& g) {
    double mean[3], scale[3], q[4], opacity = 0;
    std::array<double, 3 * kMostCoefficients> sh{};
    if (!finite(from.position, k, 3, "POSITION", false, mean) || !finite(from.scale, k, 3, "SCALE", true, scale) ||
        !finite(from.rotation, k, 4, "ROTATION", false, q) || !finite(from.opacity, k, 1, "OPACITY", false, &opacity))
      return;
    for (std::size_t i = 0; i < from.sh.size(); ++i)
      if (!finite(from.sh[i], k, 3, i ? "SH coefficient, channel" : "colour, channel", false, &sh[3 * i])) return;
    const double squared = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    if (!(squared > 0)) {
      bad(GaussianDefect::zero_rotation, k, "ROTATION", 0, from.rotation, "a quaternion of another length than 0");
      return;
    }
    // Unchanged if its length is 1 up to rounding.
    const double norm = std::abs(squared - 1) < 1e-6 ? 1 : std::sqrt(squared);
    g.means.insert(g.means.end(),
                   {static_cast<float>(-mean[0]), static_cast<float>(-mean[1]), static_cast<float>(mean[2])});
    for (const double v : scale) g.scales.push_back(static_cast<float>(v));
    g.quats.insert(g.quats.end(), {static_cast<float>(q[3] / norm), static_cast<float>(-q[0] / norm),
                                   static_cast<float>(-q[1] / norm), static_cast<float>(q[2] / norm)});
    g.opacities.push_back(static_cast<float>(std::clamp(opacity, 0.0, 1.0)));
    for (std::size_t c = 0; c < 3 && from.is_colour; ++c)
      sh[c] = (srgb_encoded(std::clamp(sh[c], 0.0, 1.0)) - 0.5) / kShC0;
    for (std::size_t i = 0; i < coefficients(g.sh_degree); ++i)
      for (std::size_t c = 0; c < 3; ++c) g.sh.push_back(sign_of(i) * static_cast<float>(sh[3 * i + c]));
    ++g.count;
  }

  // Reserves memory for `count` Gaussians.
  static void reserve(Gaussians& g, std::size_t count) {
    g.means.reserve(3 * count);
    g.scales.reserve(3 * count);
    g.quats.reserve(4 * count);
    g.opacities.reserve(count);
    g.sh.reserve(3 * g.sh_count() * count);
  }

  // What write_glb_scene() notes, unless another program has moved the Gaussians since.
  void read_extras(Scene& scene) const {
    const GltfValue extras = document_.root()["extras"];
    if (!extras.exists() || !extras.json().is_object()) return;
    const GltfValue notes = extras["vsplat"];
    if (!notes.exists() || found_.size() != 1 || found_.front().moved) return;
    read_notes(document_.name() + ": extras", notes.json(), scene);
    scene.antialias = notes["antialias"].flag(false);
  }

  GltfDocument& document_;
  GaussianSkips skips_;
  std::vector<Splats> found_;
  std::map<const nlohmann::json*, std::vector<GltfValue>> parts_;  // of each mesh
};

}  // namespace

Scene read_gltf_scene(const std::string& name, std::span<const std::byte> content, SkippedGaussians* skipped) {
  GltfDocument document(name, content, "");
  return SplatsReader(document, skipped).read();
}

Scene read_gltf_file(const std::string& path, SkippedGaussians* skipped) {
  const std::vector<unsigned char> content = read_file(path);
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  GltfDocument document(path, std::as_bytes(std::span(content)), folder.empty() ? "." : folder.string());
  return SplatsReader(document, skipped).read();
}

}  // namespace vsplat
