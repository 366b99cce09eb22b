// Nearest-neighbour search among points.
#pragma once
#include <Eigen/Core>
#include <nanoflann.hpp>

namespace vsplat {

using PointRows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

// Adaptor that nanoflann needs for a set of points. (The name of its own adaptor for Eigen differs between versions.)
struct PointsForTree {
  const PointRows& positions;
  std::size_t kdtree_get_point_count() const { return static_cast<std::size_t>(positions.rows()); }
  double kdtree_get_pt(Eigen::Index row, std::size_t axis) const {
    return positions(row, static_cast<Eigen::Index>(axis));
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};
using PointTree =
    nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Adaptor<double, PointsForTree, double, Eigen::Index>,
                                        PointsForTree, 3, Eigen::Index>;

}  // namespace vsplat
