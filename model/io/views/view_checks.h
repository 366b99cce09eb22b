// Shared by the readers of posed views: checks every number read.
#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "model/io/views/view_set.h"

namespace vsplat {

inline constexpr int max_picture_side = 65535;

// Parses a whole JSON file. The words NaN and Infinity, which Python writes, become strings; number() names them in its
// error.
nlohmann::json read_json(const std::filesystem::path& path);

// At most 60 characters of the value, for a message.
std::string excerpt(const nlohmann::json& value);

// `where` begins every message: the path, and the frame with its index and name. Each function throws Error(format) for
// a wrong type and Error(input) for a value that is not finite or out of range.
double number(const std::string& where, const char* field, const nlohmann::json& value);
int picture_side(const std::string& where, const char* field, double value);
template <int Rows, int Cols>
Eigen::Matrix<double, Rows, Cols> matrix(const std::string& where, const char* field, const nlohmann::json& value);
Eigen::Vector3d vector3(const std::string& where, const char* field, const nlohmann::json& value);

// Runs `work` on the view. If it throws Error(format), (input) or (file), the error becomes ListedView::problem, and
// the view must no longer be used.
void noting_problems(ListedView& view, const std::function<void()>& work);

// Checks that the matrix is a rotation and translation, and makes it exactly orthonormal if rounding in the file left
// small errors. Error(input) describes what is wrong with any other matrix.
Eigen::Matrix4d checked_rigid(const std::string& where, const char* field, const Eigen::Matrix4d& m);
Eigen::Matrix4d rigid_inverse(const Eigen::Matrix4d& m);

// Checks the known ones of size, focal lengths, principal point and distortion; unknown ones pass. A lens that folds
// back well inside the picture is refused.
void check_intrinsics(const std::string& where, const Camera& camera);

}  // namespace vsplat
