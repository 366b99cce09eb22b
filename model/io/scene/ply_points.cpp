#include "model/io/scene/ply_points.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "model/io/scene/ply_file.h"
#include "model/io/scene/ply_header.h"
#include "model/io/scene/ply_rows.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

// Converts to 0 to 255; float colours are in 0 to 1.
std::uint8_t point_colour(float value, PlyType type) {
  const bool is_float = type == PlyType::f32 || type == PlyType::f64;
  const float byte = is_float ? 255 * value : value;
  return static_cast<std::uint8_t>(std::lround(byte >= 0 ? std::min(byte, 255.0f) : 0.0f));  // NaN becomes 0
}

}  // namespace

std::vector<ColoredPoint> read_ply_points(const std::string& path) {
  PlyFile in(path);
  const PlyHeader header = read_ply_header(in);
  const auto vertex = std::find_if(header.elements.begin(), header.elements.end(),
                                   [](const PlyElement& e) { return e.name == "vertex"; });
  if (vertex == header.elements.end() || vertex->count == 0) fail(Status::input, "{}: lists no points", path);
  std::vector<const PlyProperty*> wanted;
  for (const char* name : {"x", "y", "z"}) {
    wanted.push_back(vertex->find(name));
    if (!wanted.back()) fail(Status::format, "{}: its vertices have no {}: points are expected", path, name);
  }
  for (const char* name : {"red", "green", "blue"})
    if (const PlyProperty* p = vertex->find(name)) wanted.push_back(p);
  const bool coloured = wanted.size() == 6;
  if (!coloured) wanted.resize(3);
  const std::unique_ptr<PlyRows> rows = PlyRows::open(in, header, *vertex, wanted);
  std::vector<ColoredPoint> out;
  std::array<float, 6> values{};
  for (std::uint64_t k = 0; k < vertex->count; ++k) {
    rows->next(values.data());
    ColoredPoint point{{}, {128, 128, 128}, -1, 0};
    for (std::size_t i = 0; i < 3; ++i) {
      point.position[static_cast<Eigen::Index>(i)] = rows->value(i);
      if (!(std::abs(rows->value(i)) <= 1e30))
        fail(Status::input, "{}: vertex {}: {} is {}, a finite number within 1e30 is expected", path, k,
             wanted[i]->name, rows->value(i));
    }
    for (std::size_t i = 0; coloured && i < 3; ++i) point.rgb[i] = point_colour(values[3 + i], wanted[3 + i]->type);
    out.push_back(point);
  }
  return out;
}

}  // namespace vsplat
