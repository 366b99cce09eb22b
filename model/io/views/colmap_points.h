// The sparse points of a COLMAP model: points3D.bin (preferred) or points3D.txt.
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace vsplat {

struct ColoredPoint {
  Eigen::Vector3d position;  // in the model's world, finite
  std::array<std::uint8_t, 3> rgb;
  double error;         // mean reprojection error in pixels; negative if COLMAP has not computed it
  std::uint64_t track;  // number of images that see the point
};

// points3D.bin or points3D.txt in a model's folder; "" if there is neither.
std::filesystem::path colmap_points_file(const std::filesystem::path& model);

// The points of a model in file order. `path` as for read_views(): a folder with the model in sparse/0, sparse, colmap
// or itself, a file of a model, or a file of other cameras with a model beside it (which must then use the same world
// as those cameras: the files do not say). Error(file) if there is no model or no points3D, Error(format) if it is
// damaged, Error(input) if a number is not finite or no point is listed. Memory is bounded by the size of the file.
std::vector<ColoredPoint> read_colmap_points(const std::filesystem::path& path);

struct ColmapSightings {
  std::vector<ColoredPoint> points;
  std::map<std::uint32_t, std::vector<std::size_t>> seen_by;  // the points that an image (IMAGE_ID) sees
};

// `path` and errors as for read_colmap_points().
ColmapSightings read_colmap_sightings(const std::filesystem::path& path);

}  // namespace vsplat
