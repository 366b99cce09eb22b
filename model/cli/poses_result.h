// What COLMAP has found: which of its models is the largest, and what it holds.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace command {

struct FoundModel {
  std::filesystem::path folder;
  std::uint64_t pictures = 0;
};
// The models in a folder, the one with the most pictures first.
std::vector<FoundModel> find_models(const std::filesystem::path& sparse);

struct FoundPoints {
  std::uint64_t count = 0;
  double error = 0;  // mean reprojection error over the points, in pixels; below 0: unknown
};
// The points of a model (points3D.bin). std::runtime_error if the file is damaged.
FoundPoints read_points(const std::filesystem::path& model);

// How many features COLMAP's logs name for each picture.
std::map<std::string, std::uint64_t> features_in(const std::vector<std::filesystem::path>& logs);

}  // namespace command
