// Which of the listed views are used.
#pragma once
#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "model/io/views/view_set.h"

namespace vsplat {

inline constexpr int max_views = 16;

struct Group {
  std::vector<int> members;  // ascending, not empty
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
};

// k-means of camera positions, the same everywhere: starts from position 0 and then always the one farthest from those
// chosen; Lloyd's steps to convergence; ties go to the lower index; groups ordered by their lowest member. Fewer than k
// groups where fewer than k positions differ. Positions finite, 1 <= k.
std::vector<Group> kmeans(std::span<const Eigen::Vector3d> positions, int k);

// Of each group the member nearest its mean, in the groups' order.
std::vector<int> nearest_members(std::span<const Eigen::Vector3d> positions, std::span<const Group> groups);

struct ViewRequest {
  std::vector<std::string> names;  // a picture's path as listed, its file name or stem, or @INDEX among all listed
  int wanted = 4;                  // how many, where no names are given
  int least = 4;                   // fewer are warned of
};

// Indices into `set.views`, the reference view first. Named: those, in that order. Else, with more pictures than
// wanted, of each of `wanted` groups the view nearest its mean; else all, as listed, with a warning where they are
// fewer than `least`; where pictures are left over, how many are used is said. Error(usage) for a name that is unknown,
// ambiguous, there twice or without a picture, and for more than 16 names; Error(file) where a view chosen has a mask
// listed that is not there; Error(input) where none is left.
std::vector<int> choose_views(const ViewSet& set, const ViewRequest& request);

// Those named, as ViewRequest has them but in any number, or all that have a picture. Errors as choose_views(); `field`
// is what they call the names.
std::vector<int> listed_views(const ViewSet& set, const std::vector<std::string>& names,
                              const char* field = "vsplat_input_options.names");

// `wanted` of these views: of each of so many groups the view nearest its mean; all where they are no more.
std::vector<int> spread_views(const ViewSet& set, std::span<const int> among, int wanted);

}  // namespace vsplat
