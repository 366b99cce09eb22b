// Which views of an object an evaluation gives to the network, and from which it asks for pictures.
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
  std::vector<int> inputs;  // the first of each of as many k-means groups as inputs are asked for, in their order
  std::vector<int> novel;   // never an input; fewer than four or ten where the object has no more
};

// `seed` and the object's name decide what is random. Error(input) where all views are inputs.
EvaluationViews evaluation_views(std::span<const Eigen::Vector3d> positions, int inputs, Protocol protocol,
                                 std::uint64_t seed, const std::string& object);

// The same of a set with parts: the inputs from the positions to train on, the novel views from those for tests.
// Indices into all of `positions`; `to_test`: one for each. Error(input) where a part is empty.
EvaluationViews evaluation_views_of_parts(std::span<const Eigen::Vector3d> positions, const std::vector<bool>& to_test,
                                          int inputs, Protocol protocol, std::uint64_t seed, const std::string& object);

// Of these views the one whose direction from the centre is nearest to that of `position`, by angle; the first where
// several are.
int nearest_view(std::span<const Eigen::Vector3d> positions, std::span<const int> views,
                 const Eigen::Vector3d& position, const Eigen::Vector3d& centre);

}  // namespace vsplat
