#include "model/io/scene/scene_notes.h"

#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>

#include "model/base/json_fields.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

using nlohmann::json;

bool is_float(double v) { return std::abs(v) <= std::numeric_limits<float>::max(); }  // false for NaN

// The field's numbers, finite as floats; nothing if the object has no such field.
template <std::size_t N>
std::optional<std::array<double, N>> numbers(const std::string& what, const json& notes, const char* field) {
  const auto found = notes.find(field);
  if (found == notes.end()) return std::nullopt;
  std::array<double, N> out{};
  bool good = found->is_array() && found->size() == N;
  for (std::size_t i = 0; good && i < N; ++i) {
    good = (*found)[i].is_number();
    if (good) out[i] = (*found)[i].get<double>();
    good = good && is_float(out[i]);
  }
  if (!good)
    fail(Status::format, "{}: vsplat.{} is {}: {} finite numbers are expected", what, field, json_fields::shown(*found),
         N);
  return out;
}

std::array<float, 3> place(const std::array<double, 3>& v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

}  // namespace

json notes_of(const Scene& scene) {
  json out;
  out["near"] = scene.near;
  if (!scene.offset.isZero(0)) out["offset"] = {scene.offset.x(), scene.offset.y(), scene.offset.z()};
  if (scene.up) out["up"] = *scene.up;
  if (scene.mirror) out["mirror_camera_about"] = *scene.mirror;
  if (const auto& d = scene.detail) out["detail"] = {d->pixel, d->at[0], d->at[1], d->at[2]};
  return out;
}

void read_notes(const std::string& what, const json& notes, Scene& scene) {
  if (!notes.is_object())
    fail(Status::format, "{}: vsplat is {}: an object is expected", what, json_fields::shown(notes));
  if (const auto near = notes.find("near"); near != notes.end()) {
    const double v = near->is_number() ? near->get<double>() : -1;
    if (!(v >= 0) || !is_float(v))
      fail(Status::format, "{}: vsplat.near is {}: a distance of at least 0 is expected", what,
           json_fields::shown(*near));
    scene.near = static_cast<float>(v);
  }
  if (const auto v = numbers<3>(what, notes, "offset")) {
    scene.offset = {(*v)[0], (*v)[1], (*v)[2]};
    if (scene.offset.cwiseAbs().maxCoeff() > kFarthestOffset)
      fail(Status::format, "{}: vsplat.offset: a place at most {} from the origin is expected", what, kFarthestOffset);
  }
  if (const auto v = numbers<3>(what, notes, "up")) {
    const double length = std::hypot((*v)[0], (*v)[1], (*v)[2]);
    if (!(length > 0)) fail(Status::format, "{}: vsplat.up: a direction is expected", what);
    // Unchanged if its length is 1 up to rounding.
    const double by = std::abs(length - 1) < 1e-6 ? 1 : length;
    scene.up = place({(*v)[0] / by, (*v)[1] / by, (*v)[2] / by});
  }
  if (const auto v = numbers<3>(what, notes, "mirror_camera_about")) scene.mirror = place(*v);
  if (const auto v = numbers<4>(what, notes, "detail")) {
    if (!(static_cast<float>((*v)[0]) > 0))
      fail(Status::format, "{}: vsplat.detail: a pixel's width above 0 is expected first", what);
    scene.detail = Detail{place({(*v)[1], (*v)[2], (*v)[3]}), static_cast<float>((*v)[0])};
  }
}

}  // namespace vsplat
