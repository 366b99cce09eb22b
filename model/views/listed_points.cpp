#include "model/views/listed_points.h"

#include <Eigen/Dense>
#include <cmath>
#include <map>
#include <utility>

#include "model/base/scene.h"
#include "model/base/statistics.h"
#include "model/io/scene/ply_points.h"
#include "model/io/views/colmap.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kSame = 1e-3;  // of the cameras' spread, and in radians

struct Pair {
  Camera from, to;
};

std::vector<Pair> pairs_by_name(const ViewSet& from, const ViewSet& to) {
  std::map<std::string, const Camera*> named;
  for (const ListedView& view : from.views)
    if (view.problem.empty()) named[fs::path(view.name).stem().string()] = &view.camera;
  std::vector<Pair> out;
  for (const ListedView& view : to.views)
    if (const auto at = named.find(fs::path(view.name).stem().string()); at != named.end() && view.problem.empty())
      out.push_back({*at->second, view.camera});
  return out;
}

Matrix3d rotation_of(const Camera& c) { return c.w2c.topLeftCorner<3, 3>(); }

// The rotation nearest to all rotations from a camera's axes to its partner's.
Matrix3d mean_rotation(const std::vector<Pair>& pairs) {
  Matrix3d sum = Matrix3d::Zero();
  for (const Pair& p : pairs) sum += rotation_of(p.to).transpose() * rotation_of(p.from);
  const Eigen::JacobiSVD<Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d fix = Matrix3d::Identity();
  fix(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant();
  return svd.matrixU() * fix * svd.matrixV().transpose();
}

// The similarity from one world to the other, from the cameras in both; nothing if it does not fit nine in ten of them.
std::optional<Similarity> between(const std::vector<Pair>& pairs) {
  if (pairs.size() < 2) return std::nullopt;
  const double n = static_cast<double>(pairs.size());
  Vector3d from = Vector3d::Zero(), to = Vector3d::Zero();
  for (const Pair& p : pairs) from += p.from.centre() / n, to += p.to.centre() / n;
  Similarity out;
  out.rotation = mean_rotation(pairs);
  double along = 0, squared = 0, spread = 0;
  for (const Pair& p : pairs) {
    const Vector3d turned = out.rotation * (p.from.centre() - from), there = p.to.centre() - to;
    along += turned.dot(there);
    squared += turned.squaredNorm();
    spread = std::max(spread, there.norm());
  }
  if (!(along > 0) || !(spread > 0)) return std::nullopt;
  out.scale = along / squared;
  out.translation = to - out.scale * (out.rotation * from);
  std::vector<double> off;
  for (const Pair& p : pairs) {
    const Matrix3d turn = rotation_of(p.to) * out.rotation * rotation_of(p.from).transpose();
    const double angle = (turn - Matrix3d::Identity()).norm() / std::sqrt(2.0);
    off.push_back(std::max(angle, (out.apply(p.from.centre()) - p.to.centre()).norm() / spread));
  }
  if (quantile(off, 0.9) > kSame) return std::nullopt;
  // The worlds are identical: positions stay unchanged to the last bit.
  const double moved = (out.apply(from) - from).norm() / spread + (out.rotation - Matrix3d::Identity()).norm();
  if (moved + std::abs(out.scale - 1) < kSame) return Similarity();
  return out;
}

// A model in the list's folder or, as with nerfstudio, in its subfolder colmap/.
fs::path model_beside(const fs::path& list) {
  const fs::path folder = list.has_parent_path() ? list.parent_path() : fs::path(".");
  const fs::path found = find_colmap_model(folder);
  return found.empty() ? find_colmap_model(folder / "colmap") : found;
}

ListedPoints points_beside(const ViewSet& set, const fs::path& model, const fs::path& file) {
  ListedPoints out{read_colmap_points(model), file};
  const std::vector<Pair> pairs = pairs_by_name(read_colmap(model), set);
  out.placed = pairs.size() >= 2;
  if (!out.placed) return out;
  const std::optional<Similarity> move = between(pairs);
  if (!move)
    fail(Status::input,
         "{}: the COLMAP model beside {} has cameras of the same names at other places: its points are in other "
         "coordinates",
         model.string(), set.source.string());
  const bool same = move->scale == 1 && move->rotation.isIdentity(0) && move->translation.isZero(0);
  if (same) return out;
  for (ColoredPoint& point : out.points) point.position = move->apply(point.position);
  return out;
}

}  // namespace

std::optional<ListedPoints> listed_points(const ViewSet& set) {
  std::error_code error;
  const bool colmap = fs::is_directory(set.source, error);
  if (!colmap && !set.points.empty()) return ListedPoints{read_ply_points(set.points.string()), set.points};
  if (!colmap && !fs::is_regular_file(set.source, error)) return std::nullopt;  // made in memory
  const fs::path model = colmap ? set.source : model_beside(set.source);
  if (model.empty()) return std::nullopt;
  const fs::path file = colmap_points_file(model);
  if (file.empty()) return std::nullopt;
  if (colmap) return ListedPoints{read_colmap_points(model), file};
  return points_beside(set, model, file);
}

}  // namespace vsplat
