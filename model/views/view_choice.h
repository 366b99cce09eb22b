// Chooses the listed views to use.
#pragma once
#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "model/io/views/view_set.h"
#include "runtime/option.h"

namespace vsplat {

inline constexpr int max_views = 16;

struct Group {
  std::vector<int> members;  // ascending, not empty
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
};

// Deterministic k-means of camera positions. Starts from position 0 and then repeatedly takes the position farthest
// from those chosen; runs Lloyd's steps to convergence; ties go to the lower index; groups are sorted by their lowest
// member. Fewer than k groups if fewer than k positions differ. Positions must be finite, 1 <= k.
std::vector<Group> kmeans(std::span<const Eigen::Vector3d> positions, int k);

// The member nearest to the mean of each group, in the groups' order.
std::vector<int> nearest_members(std::span<const Eigen::Vector3d> positions, std::span<const Group> groups);

struct ViewRequest {
  std::vector<std::string> names;  // a picture's path as listed, its file name or stem, or @INDEX among all listed
  int wanted = 4;                  // number of views if no names are given
  int least = 4;                   // a warning if there are fewer
};

// Indices into `set.views`, the reference view first. Named views are returned in the given order. Otherwise, if there
// are more pictures than `wanted`, the views are clustered into `wanted` groups, and the view nearest to each mean is
// chosen; if not, all are returned as listed, with a warning if they are fewer than `least`. If pictures are unused,
// the log says how many are used. Error(usage) for a name that is unknown, ambiguous, duplicate or without a picture,
// and for more than 16 names; Error(file) if a chosen view lists a mask that does not exist; Error(input) if no view is
// left.
std::vector<int> choose_views(const ViewSet& set, const ViewRequest& request);

// The named views, as in ViewRequest but in any number, or all views with a picture. Errors as choose_views(), about
// `option`.
std::vector<int> listed_views(const ViewSet& set, const std::vector<std::string>& names, Option option = Option::views);

// `wanted` of these views: the one nearest to the mean of each of `wanted` groups; all if there are no more than that.
std::vector<int> spread_views(const ViewSet& set, std::span<const int> among, int wanted);

}  // namespace vsplat
