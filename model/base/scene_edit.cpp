#include "model/base/scene_edit.h"

#include <algorithm>
#include <cstdint>

#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/option.h"

namespace vsplat {
namespace {

// Converts colours of the opposite direction to colours of the direction: f(-d) negates the odd bands.
void turn_about(Gaussians& g) {
  for (std::size_t k = 0; k < g.count; ++k)
    for (const std::size_t degree : {1, 3})
      for (std::size_t i = degree * degree; i < std::min((degree + 1) * (degree + 1), g.sh_count()); ++i)
        for (std::size_t c = 0; c < 3; ++c) g.sh[3 * (k * g.sh_count() + i) + c] *= -1;
}

// Leaves the scene identical bit for bit if nothing moves.
void move_to(Scene& scene, const Similarity& move, const Eigen::Vector3d& offset) {
  const bool stays = move.scale == 1 && move.rotation.isIdentity(0) && move.translation.isZero(0);
  if (!stays || scene.offset != offset) transform(scene, move, offset);
}

void add(std::vector<float>& to, const std::vector<float>& from) { to.insert(to.end(), from.begin(), from.end()); }

// Keeps only the values of the Gaussians in `kept`; each Gaussian has `each` values.
void keep_values(std::vector<float>& values, std::size_t each, const std::vector<std::size_t>& kept) {
  for (std::size_t i = 0; i < kept.size(); ++i)
    std::copy_n(&values[each * kept[i]], each, &values[each * i]);  // kept[i] >= i
  values.resize(each * kept.size());
}

}  // namespace

void drop_mirror(Scene& scene) {
  if (!scene.mirror) return;
  turn_about(scene.gaussians);
  scene.mirror.reset();
}

void append(Scene& to, const Scene& other, const Similarity& move) {
  Scene more = other;
  if (to.gaussians.count == 0) {  // far from the world's origin, its precision is kept
    move_to(more, move, other.offset.isZero(0) ? to.offset : move.apply(other.offset));
    to = std::move(more);
    return;
  }
  if (other.gaussians.count == 0) return;
  if (to.gaussians.kind != other.gaussians.kind)
    fail(Status::input, "one scene has surfels and the other has volumes: {} turns surfels into volumes",
         Option::surfels_to_gaussians);
  if (to.gaussians.count + other.gaussians.count > INT32_MAX)
    fail(Status::usage, "{} and {} Gaussians are more than {}", to.gaussians.count, other.gaussians.count, INT32_MAX);
  move_to(more, move, to.offset);
  if (to.mirror != more.mirror) {
    warn(
        "the scenes have different mirror points: from now on, view-dependent colours follow the viewing direction "
        "itself, and they change for Gaussians far from their scene's mirror point");
    drop_mirror(to);
    drop_mirror(more);
  }
  if (to.antialias != more.antialias)
    warn(
        "one of the scenes is made to be drawn with anti-aliasing and the other is not: all of the result is drawn {} "
        "it, as the first one, and what is smaller than a pixel in the other one looks {}",
        to.antialias ? "with" : "without", to.antialias ? "fainter" : "larger");
  to.near = std::min(to.near, more.near);
  const int degree = std::max(to.gaussians.sh_degree, more.gaussians.sh_degree);
  set_degree(to.gaussians, degree);
  set_degree(more.gaussians, degree);
  append(to.gaussians, more.gaussians);
}

void set_degree(Gaussians& g, int degree) {
  if (degree == g.sh_degree) return;
  const std::size_t before = 3 * g.sh_count();
  g.sh_degree = degree;
  const std::size_t each = 3 * g.sh_count();
  std::vector<float> sh(each * g.count);
  for (std::size_t k = 0; k < g.count; ++k) std::copy_n(&g.sh[before * k], std::min(before, each), &sh[each * k]);
  g.sh = std::move(sh);
}

void append(Gaussians& to, const Gaussians& more) {
  to.count += more.count;
  add(to.means, more.means);
  add(to.scales, more.scales);
  add(to.quats, more.quats);
  add(to.opacities, more.opacities);
  add(to.sh, more.sh);
}

void keep(Gaussians& g, const std::function<bool(std::size_t)>& keeps) {
  std::vector<std::size_t> kept;
  for (std::size_t k = 0; k < g.count; ++k)
    if (keeps(k)) kept.push_back(k);
  if (kept.size() == g.count) return;
  keep_values(g.means, 3, kept);
  keep_values(g.scales, static_cast<std::size_t>(scales_of(g.kind)), kept);
  keep_values(g.quats, 4, kept);
  keep_values(g.opacities, 1, kept);
  keep_values(g.sh, 3 * g.sh_count(), kept);
  g.count = kept.size();
}

}  // namespace vsplat
