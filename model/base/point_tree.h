// The nearest neighbours of points.
#pragma once
#include <Eigen/Core>
#include <nanoflann.hpp>

namespace vsplat {

using PointRows = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

// What nanoflann asks of a set of points. (Its own adaptor for Eigen names its tree otherwise from version to version.)
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
