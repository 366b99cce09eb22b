// The sparse points of a COLMAP model: points3D.bin (preferred) or points3D.txt.
#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

namespace vsplat {

struct ColoredPoint {
  Eigen::Vector3d position;  // in the model's world, finite
  std::array<std::uint8_t, 3> rgb;
  double error;         // mean reprojection error in pixels; negative where COLMAP has not computed it
  std::uint64_t track;  // how many images see it
};

// points3D.bin or points3D.txt of a model's folder; "" where there is neither.
std::filesystem::path colmap_points_file(const std::filesystem::path& model);

// The points of a model, in the file's order. `path`: what read_views() takes: a folder with the model in sparse/0,
// sparse, colmap or itself, a file of a model, or a file of other cameras beside which a model lies (its world must
// then be that of those cameras: nothing in the files tells). Error(file) where no model or no points3D is there,
// Error(format) where it is damaged, Error(input) where a number is not finite or no point is listed. Memory is
// bounded by the size of the file.
std::vector<ColoredPoint> read_colmap_points(const std::filesystem::path& path);

}  // namespace vsplat
