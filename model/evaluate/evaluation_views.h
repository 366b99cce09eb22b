// Chooses an object's input views and novel views for an evaluation.
#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace vsplat {

enum class Protocol {
  kmeans,   // novel views: the last of each of four k-means groups of the cameras' positions
  random10  // ten at random
};

struct EvaluationViews {
  std::vector<int> inputs;  // the first view of each k-means group, in the groups' order; one group per input
  std::vector<int> novel;   // never inputs; fewer than four or ten if the object has no more
};

// `seed` and the object's name determine the random choices. Error(input) if all views are inputs.
EvaluationViews evaluation_views(std::span<const Eigen::Vector3d> positions, int inputs, Protocol protocol,
                                 std::uint64_t seed, const std::string& object);

// The same for a set with splits: chooses the inputs from the training views, the novel views from the test views.
// Returns indices into all of `positions`; `to_test` has one entry for each. Error(input) if a split is empty.
EvaluationViews evaluation_views_of_parts(std::span<const Eigen::Vector3d> positions, const std::vector<bool>& to_test,
                                          int inputs, Protocol protocol, std::uint64_t seed, const std::string& object);

// The view among `views` whose direction from the centre is nearest to that of `position`, by angle; the first of
// several.
int nearest_view(std::span<const Eigen::Vector3d> positions, std::span<const int> views,
                 const Eigen::Vector3d& position, const Eigen::Vector3d& centre);

}  // namespace vsplat
