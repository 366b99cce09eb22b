// What the readers of posed views share: every number that enters is checked here.
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

// A whole JSON file. The words NaN and Infinity, which Python writes, become strings that number() names.
nlohmann::json read_json(const std::filesystem::path& path);

// At most 60 characters of it, for a message.
std::string excerpt(const nlohmann::json& value);

// `where` begins every message: the path, and the frame with its index and name. Each throws Error(format) for a wrong
// type and Error(input) for a value that is not finite or out of range.
double number(const std::string& where, const char* field, const nlohmann::json& value);
int picture_side(const std::string& where, const char* field, double value);
template <int Rows, int Cols>
Eigen::Matrix<double, Rows, Cols> matrix(const std::string& where, const char* field, const nlohmann::json& value);
Eigen::Vector3d vector3(const std::string& where, const char* field, const nlohmann::json& value);

// Does `work` on the view; where that fails on what the list says, the view gets the problem (ListedView::problem)
// instead, and is no longer to be used.
void noting_problems(ListedView& view, const std::function<void()>& work);

// A rotation and a translation, made exactly orthonormal where rounding in the file left it a little off. Error(input)
// says what is wrong with any other matrix.
Eigen::Matrix4d checked_rigid(const std::string& where, const char* field, const Eigen::Matrix4d& m);
Eigen::Matrix4d rigid_inverse(const Eigen::Matrix4d& m);

// What is known of size, focal lengths, principal point and distortion is usable; what is still open passes. A lens
// that folds back well inside the picture is refused.
void check_intrinsics(const std::string& where, const Camera& camera);

}  // namespace vsplat
