#include "model/io/views/view_checks.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <fstream>
#include <string_view>
#include <vector>

#include "model/base/lens.h"
#include "runtime/fail.h"
#include "runtime/files/file.h"
#include "runtime/json_text.h"

namespace vsplat {
namespace {

using nlohmann::json;

constexpr std::uintmax_t max_json_bytes = std::uintmax_t{1}
                                          << 26;  // 60,000 cameras; parsed it takes some ten times that
constexpr int max_json_depth = 32;                // cameras need 4; code that walks parsed values recurses
constexpr double max_coefficient = 1e6;           // of a lens
constexpr double max_coordinate = 1e12;           // beyond it, floats cannot represent differences of positions
constexpr double rigid_tolerance = 1e-3;

// Python's json module writes NaN, Infinity and -Infinity, which are not JSON. This puts them between quotes.
std::string quote_words_of_python(const std::string& path, const std::string& text) {
  std::string out;
  out.reserve(text.size() + 64);
  bool in_string = false;
  int depth = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string && c == '\\' && i + 1 < text.size()) {
      out += c;
      out += text[++i];
      continue;
    }
    if (c == '"') in_string = !in_string;
    if (!in_string && (c == ']' || c == '}')) --depth;
    if (!in_string && (c == '[' || c == '{') && ++depth > max_json_depth)
      fail(Status::format, "{}: byte {}: nested deeper than {} levels: no file of cameras", path, i, max_json_depth);
    bool replaced = false;
    if (!in_string && (c == 'N' || c == 'I' || c == '-')) {
      for (const std::string_view word : {"NaN", "Infinity", "-Infinity"}) {
        if (text.compare(i, word.size(), word) != 0) continue;
        out += '"';
        out += word;
        out += '"';
        i += word.size() - 1;
        replaced = true;
        break;
      }
    }
    if (!replaced) out += c;
  }
  return out;
}

// Reads a pipe or another file whose size is unknown beforehand.
std::string read_stream(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) fail(Status::file, "{}: cannot be opened", path.string());
  std::string out;
  std::vector<char> part(1 << 16);
  while (in.read(part.data(), static_cast<std::streamsize>(part.size())), in.gcount() > 0) {
    out.append(part.data(), static_cast<std::size_t>(in.gcount()));
    if (out.size() > max_json_bytes)
      fail(Status::format, "{}: is too large for a file of cameras (more than 64 MiB)", path.string());
  }
  return out;
}

}  // namespace

json read_json(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) fail(Status::file, "{}: no such file", path.string());
  if (std::filesystem::is_directory(path, error))
    fail(Status::file, "{}: is a folder, a file is expected", path.string());
  std::string text;
  if (!std::filesystem::is_regular_file(path, error)) {
    text = read_stream(path);
  } else {
    if (std::filesystem::file_size(path, error) > max_json_bytes || error)
      fail(Status::format, "{}: is too large for a file of cameras (more than 64 MiB)", path.string());
    const std::vector<unsigned char> bytes = read_file(path.string());
    text.assign(bytes.begin(), bytes.end());
  }
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff"))
    fail(Status::format, "{0}: is in UTF-16, UTF-8 is expected: iconv -f UTF-16 -t UTF-8 {0} > utf8.json",
         path.string());
  if (text.starts_with("\xef\xbb\xbf")) text.erase(0, 3);  // a byte order mark
  return parse_json(path.string(), quote_words_of_python(path.string(), text));
}

std::string excerpt(const json& value) {
  std::string text = value.dump(-1, ' ', true, json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

double number(const std::string& where, const char* field, const json& value) {
  if (value.is_string()) {
    const auto& word = value.get_ref<const std::string&>();
    if (word == "NaN" || word == "Infinity" || word == "-Infinity")
      fail(Status::input, "{}: {} is {}, a finite number is expected", where, field, word);
  }
  if (!value.is_number()) fail(Status::format, "{}: {} is {}, a number is expected", where, field, excerpt(value));
  const double out = value.get<double>();
  if (!std::isfinite(out)) fail(Status::input, "{}: {} is {}, a finite number is expected", where, field, out);
  return out;
}

int picture_side(const std::string& where, const char* field, double value) {
  if (!(value >= 1 && value <= max_picture_side) || value != std::floor(value))
    fail(Status::input, "{}: {} is {}, a whole number of pixels from 1 to {} is expected", where, field, value,
         max_picture_side);
  return static_cast<int>(value);
}

template <int Rows, int Cols>
Eigen::Matrix<double, Rows, Cols> matrix(const std::string& where, const char* field, const json& value) {
  const auto misshaped = [&]() {
    fail(Status::format, "{}: {} is {}, {} rows of {} numbers are expected", where, field, excerpt(value), Rows, Cols);
  };
  if (!value.is_array() || value.size() != Rows) misshaped();
  Eigen::Matrix<double, Rows, Cols> out;
  for (int r = 0; r < Rows; ++r) {
    if (!value[r].is_array() || value[r].size() != Cols) misshaped();
    for (int c = 0; c < Cols; ++c)
      out(r, c) = number(where, fmt::format("{}[{}][{}]", field, r, c).c_str(), value[r][c]);
  }
  return out;
}

template Eigen::Matrix<double, 1, 6> matrix<1, 6>(const std::string&, const char*, const json&);
template Eigen::Matrix<double, 3, 3> matrix<3, 3>(const std::string&, const char*, const json&);
template Eigen::Matrix<double, 3, 4> matrix<3, 4>(const std::string&, const char*, const json&);
template Eigen::Matrix<double, 4, 4> matrix<4, 4>(const std::string&, const char*, const json&);

Eigen::Vector3d vector3(const std::string& where, const char* field, const json& value) {
  if (!value.is_array() || value.size() != 3)
    fail(Status::format, "{}: {} is {}, three numbers are expected", where, field, excerpt(value));
  Eigen::Vector3d out;
  for (int i = 0; i < 3; ++i) out[i] = number(where, fmt::format("{}[{}]", field, i).c_str(), value[i]);
  return out;
}

void noting_problems(ListedView& view, const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& e) {
    if (e.status() != Status::format && e.status() != Status::input && e.status() != Status::file) throw;
    view.problem = e.what();
    view.problem_status = e.status();
    view.picture.clear();
    view.mask.reset();
    view.camera.w2c.setIdentity();
  }
}

Eigen::Matrix4d checked_rigid(const std::string& where, const char* field, const Eigen::Matrix4d& m) {
  if (!m.allFinite()) fail(Status::input, "{}: {} holds a value that is not finite", where, field);
  if (m.isZero(0))
    fail(Status::input, "{}: {} is all zeros: the view has no pose (programs write this if they found none)", where,
         field);
  if ((m.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).cwiseAbs().maxCoeff() > 1e-6)
    fail(Status::input, "{}: the last row of {} is {} {} {} {}, 0 0 0 1 is expected{}", where, field, m(3, 0), m(3, 1),
         m(3, 2), m(3, 3), m.topRightCorner<3, 1>().isZero() ? " (the matrix seems to be transposed)" : "");
  if (m.topRightCorner<3, 1>().cwiseAbs().maxCoeff() > max_coordinate)
    fail(Status::input, "{}: {} is further than {} from the origin", where, field, max_coordinate);
  const Eigen::Matrix3d R = m.topLeftCorner<3, 3>();
  const double largest = R.cwiseAbs().maxCoeff();
  const double det = largest > 0 ? (R / largest).determinant() : 0.0;
  if (std::abs(det) < 1e-6) fail(Status::input, "{}: {} is singular: it is no rotation and translation", where, field);
  const double scale = largest * std::cbrt(std::abs(det));
  const auto off = [](const Eigen::Matrix3d& r) {
    return (r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  };
  if (const double d = off(R / scale); d > rigid_tolerance)
    fail(Status::input, "{}: {} is not rigid: its rotation is off orthonormal by {:.2g} (at most {} is taken)", where,
         field, d, rigid_tolerance);
  if (det < 0)
    fail(Status::input, "{}: {} mirrors: its rotation has determinant -1, a proper one is expected", where, field);
  if (std::abs(scale - 1) > rigid_tolerance)
    fail(Status::input,
         "{}: {} scales by {:.6g}: a pose is a rotation and a translation only; divide its 3 x 3 part by this factor",
         where, field, scale);
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out.topRightCorner<3, 1>() = m.topRightCorner<3, 1>();
  out.topLeftCorner<3, 3>() = R;
  if (off(R) > 1e-12) {  // otherwise the file's digits are kept
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
    out.topLeftCorner<3, 3>() = svd.matrixU() * svd.matrixV().transpose();
  }
  return out;
}

Eigen::Matrix4d rigid_inverse(const Eigen::Matrix4d& m) {
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out.topLeftCorner<3, 3>() = m.topLeftCorner<3, 3>().transpose();
  out.topRightCorner<3, 1>() = -(m.topLeftCorner<3, 3>().transpose() * m.topRightCorner<3, 1>());
  return out;
}

namespace {

// A calibrated lens may fold back at the picture's corners; one that folds back halfway to the nearest side is refused.
void check_lens(const std::string& where, const Camera& c) {
  const double half = 0.5 * std::min({c.cx / c.fx, (c.width - c.cx) / c.fx, c.cy / c.fy, (c.height - c.cy) / c.fy});
  if (!(half > 0) || reaches(c.distortion, half)) return;  // sizes may still be unknown
  fail(Status::input,
       "{}: the lens coefficients cannot be inverted: no direction is seen {:.4g} pixels from the principal point, "
       "halfway to the side of a picture of {} x {}",
       where, half * std::min(c.fx, c.fy), c.width, c.height);
}

}  // namespace

void check_intrinsics(const std::string& where, const Camera& camera) {
  const auto open = [](double v) { return std::isnan(v); };
  for (const auto& [name, f] : {std::pair{"fx", camera.fx}, std::pair{"fy", camera.fy}})
    if (!open(f) && !(f > 1e-6 && f < 1e9))
      fail(Status::input, "{}: the focal length {} is {} pixels, a number between 1e-6 and 1e9 is expected", where,
           name, f);
  for (const auto& [name, c] : {std::pair{"cx", camera.cx}, std::pair{"cy", camera.cy}})
    if (!open(c) && !(std::abs(c) < 1e9))
      fail(Status::input, "{}: {} is {}, a position of less than 1e9 pixels either way is expected", where, name, c);
  constexpr const char* opencv[] = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  constexpr const char* fisheye[] = {"k1", "k2", "k3", "k4", "", "", "", ""};
  const Distortion& lens = camera.distortion;
  for (std::size_t i = 0; i < std::size(opencv); ++i)
    if (!(std::abs(lens.k[i]) <= max_coefficient))
      fail(Status::input, "{}: the lens coefficient {} is {}, a number of at most {} either way is expected", where,
           lens.model == Distortion::Model::fisheye ? fisheye[i] : opencv[i], lens.k[i], max_coefficient);
  check_lens(where, camera);
}

}  // namespace vsplat
