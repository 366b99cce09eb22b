#include "model/io/views/colmap_points.h"

#include <fmt/format.h>

#include <cmath>
#include <functional>

#include "model/io/any_case.h"
#include "model/io/views/colmap.h"
#include "model/io/views/colmap_file.h"
#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t point_bytes = 8 + 3 * 8 + 3 + 8 + 8;  // id, position, colour, error, track length
constexpr std::uint64_t track_bytes = 4 + 4;                  // image id, point index

bool has_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

// Positions are also stored as float; larger values are refused.
void check(const std::string& where, const ColoredPoint& point) {
  constexpr const char* names[] = {"X", "Y", "Z"};
  for (int i = 0; i < 3; ++i)
    if (!(std::abs(point.position[i]) <= 1e30))
      fail(Status::input, "{}: {} is {}, a finite number within 1e30 is expected", where, names[i], point.position[i]);
  if (!std::isfinite(point.error))
    fail(Status::input, "{}: ERROR is {}, a finite number is expected", where, point.error);
}

// Called with the index of a point and an image that sees it.
using Sighting = std::function<void(std::size_t point, std::uint32_t image)>;

std::vector<ColoredPoint> read_binary(const fs::path& path, const Sighting& sighting) {
  ColmapBytes in(path);
  const std::uint64_t n = in.count("points", point_bytes);
  std::vector<ColoredPoint> out;
  out.reserve(n);
  for (std::uint64_t i = 0; i < n; ++i) {
    const auto id = in.read<std::uint64_t>("a point's id");
    ColoredPoint point{};
    for (int k = 0; k < 3; ++k) point.position[k] = in.read<double>("a point's position");
    for (std::uint8_t& c : point.rgb) c = in.read<std::uint8_t>("a point's colour");
    point.error = in.read<double>("a point's error");
    point.track = in.count("observations", track_bytes);
    if (!sighting) in.skip(track_bytes * point.track);
    for (std::uint64_t k = 0; sighting && k < point.track; ++k) {
      sighting(out.size(), in.read<std::uint32_t>("an image's id"));
      in.skip(4);
    }
    check(fmt::format("{}: point {}", in.path(), id), point);
    out.push_back(point);
  }
  in.end();
  return out;
}

std::vector<ColoredPoint> read_text(const fs::path& path, const Sighting& sighting) {
  constexpr const char* positions[] = {"X", "Y", "Z"};
  constexpr const char* colours[] = {"R", "G", "B"};
  ColmapLines in(path);
  std::vector<ColoredPoint> out;
  while (in.record_line()) {
    const auto id = in.value<std::uint64_t>("POINT3D_ID");
    ColoredPoint point{};
    for (int k = 0; k < 3; ++k) point.position[k] = in.value<double>(positions[k]);
    for (std::size_t k = 0; k < 3; ++k) {
      const int c = in.value<int>(colours[k]);
      if (c < 0 || c > 255) fail(Status::input, "{}: {} is {}, 0 to 255 is expected", in.where(), colours[k], c);
      point.rgb[k] = static_cast<std::uint8_t>(c);
    }
    point.error = in.value<double>("ERROR");
    check(fmt::format("{} (point {})", in.where(), id), point);
    std::uint64_t words = 0;
    while (!in.rest().empty()) {
      const bool image = words++ % 2 == 0;
      if (sighting && image)
        sighting(out.size(), in.value<std::uint32_t>("IMAGE_ID"));
      else
        in.word();
    }
    if (words % 2 != 0)
      fail(Status::format, "{}: after ERROR come pairs IMAGE_ID POINT2D_IDX; found {} words", in.where(), words);
    point.track = words / 2;
    out.push_back(point);
  }
  return out;
}

// The model's folder: the folder of the given file, or one below or beside it.
fs::path model_of(const fs::path& path) {
  const fs::path folder = !has_file(path) ? path : path.has_parent_path() ? path.parent_path() : fs::path(".");
  // A file that belongs to a model means that model, not another one in a subfolder.
  const bool own = has_file(path) && (path.extension() == ".bin" || path.extension() == ".txt");
  return own && is_colmap_model(folder) ? folder : find_colmap_model(folder);
}

fs::path need_model(const fs::path& path) {
  fs::path out = model_of(path);
  if (out.empty())
    fail(Status::file,
         "{}: no COLMAP model whose points could be read: cameras, images and points3D, as .bin or .txt, are expected "
         "in "
         "sparse/0, sparse, colmap or the folder itself",
         path.string());
  return out;
}

std::vector<ColoredPoint> read_points(const fs::path& model, const Sighting& sighting) {
  const fs::path file = colmap_points_file(model);
  if (file.empty())
    fail(Status::file, "{}: the COLMAP model has no points: points3D.bin or points3D.txt is expected", model.string());
  std::vector<ColoredPoint> out =
      lower_case(file.extension().string()) == ".bin" ? read_binary(file, sighting) : read_text(file, sighting);
  if (out.empty()) fail(Status::input, "{}: lists no points", file.string());
  return out;
}

}  // namespace

fs::path colmap_points_file(const fs::path& model) {
  for (const char* name : {"points3D.bin", "points3D.txt"})
    if (const fs::path file = in_any_case(model, name); has_file(file)) return file;
  return {};
}

std::vector<ColoredPoint> read_colmap_points(const fs::path& path) { return read_points(need_model(path), {}); }

ColmapSightings read_colmap_sightings(const fs::path& path) {
  ColmapSightings out;
  out.points = read_points(need_model(path),
                           [&](std::size_t point, std::uint32_t image) { out.seen_by[image].push_back(point); });
  return out;
}

}  // namespace vsplat
