#include "model/io/scene/ply_comments.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <sstream>
#include <vector>

#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

template <class Number>
std::vector<Number> comment_numbers(const std::string& path, const std::string& comment, std::istringstream& in,
                                    std::size_t count) {
  std::vector<Number> out;
  for (std::string word; in >> word;) {
    Number v = 0;
    const auto [end, problem] = std::from_chars(word.data(), word.data() + word.size(), v);
    if (problem != std::errc() || end != word.data() + word.size() || !std::isfinite(v)) break;
    out.push_back(v);
  }
  if (out.size() != count || !in.eof())
    fail(Status::format, "{}: comment \"{}\": {} finite number{} expected", path, printable(comment), count,
         count == 1 ? " is" : "s are");
  return out;
}

// Normalised to length 1, but unchanged if the length is 1 up to rounding.
std::array<float, 3> direction(const std::string& path, const std::string& comment, const std::vector<float>& v) {
  const double length = std::hypot(static_cast<double>(v[0]), static_cast<double>(v[1]), static_cast<double>(v[2]));
  if (length == 0) fail(Status::format, "{}: comment \"{}\": a direction is expected", path, printable(comment));
  if (std::abs(length - 1) < 1e-6) return {v[0], v[1], v[2]};
  const auto part = [&](int i) { return static_cast<float>(v[i] / length); };
  return {part(0), part(1), part(2)};
}

// How to draw the file's Gaussians, as several programs write it. Others than these are drawn as `default`.
void read_render_mode(const std::string& path, const std::string& mode, GaussianKind kind, Scene& scene) {
  if (mode == "mip" && kind == GaussianKind::surfel) {
    warn("{}: comment \"SplatRenderMode: mip\" is ignored: anti-aliasing is for volumes, and these are surfels", path);
    return;
  }
  scene.antialias = mode == "mip";
  if (mode != "mip" && mode != "default" && mode != "2dgs")
    warn("{}: comment \"SplatRenderMode: {}\" is ignored: default, mip or 2dgs expected", path, printable(mode));
}

}  // namespace

void read_comments(const std::string& path, const PlyHeader& header, GaussianKind kind, Scene& scene) {
  for (const std::string& comment : header.comments) {
    std::istringstream in(comment);
    std::string who, what;
    in >> who >> what;
    if (who == "SplatRenderMode:") read_render_mode(path, what, kind, scene);
    if (who == "antialiased" && what == "1") read_render_mode(path, "mip", kind, scene);  // as Postshot writes it
    if (who != "vsplat") continue;
    if (what == "near") {
      scene.near = comment_numbers<float>(path, comment, in, 1)[0];
      if (scene.near < 0)
        fail(Status::format, "{}: comment \"{}\": a distance of at least 0 is expected", path, printable(comment));
    } else if (what == "mirror_camera_about") {
      const std::vector<float> p = comment_numbers<float>(path, comment, in, 3);
      scene.mirror = {p[0], p[1], p[2]};
    } else if (what == "offset") {
      const std::vector<double> p = comment_numbers<double>(path, comment, in, 3);
      scene.offset = {p[0], p[1], p[2]};
      if (scene.offset.cwiseAbs().maxCoeff() > kFarthestOffset)
        fail(Status::format, "{}: comment \"{}\": a place at most {} from the origin is expected", path,
             printable(comment), kFarthestOffset);
    } else if (what == "detail") {
      const std::vector<float> p = comment_numbers<float>(path, comment, in, 4);
      if (!(p[0] > 0))
        fail(Status::format, "{}: comment \"{}\": a pixel's width above 0 is expected", path, printable(comment));
      scene.detail = Detail{{p[1], p[2], p[3]}, p[0]};
    } else if (what == "up") {
      scene.up = direction(path, comment, comment_numbers<float>(path, comment, in, 3));
    }
  }
}

std::string comments_of(const Scene& scene) {
  std::string out;
  out += fmt::format("comment vsplat near {}\n", scene.near);
  const Eigen::Vector3d& offset = scene.offset;
  if (!offset.isZero(0)) out += fmt::format("comment vsplat offset {} {} {}\n", offset.x(), offset.y(), offset.z());
  if (scene.up) out += fmt::format("comment vsplat up {} {} {}\n", (*scene.up)[0], (*scene.up)[1], (*scene.up)[2]);
  if (const auto& d = scene.detail)
    out += fmt::format("comment vsplat detail {} {} {} {}\n", d->pixel, d->at[0], d->at[1], d->at[2]);
  if (scene.mirror)
    out += fmt::format("comment vsplat mirror_camera_about {} {} {}\n", (*scene.mirror)[0], (*scene.mirror)[1],
                       (*scene.mirror)[2]);
  if (scene.antialias) out += "comment SplatRenderMode: mip\n";
  return out;
}

}  // namespace vsplat
