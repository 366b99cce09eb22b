// The part of a configuration for Generative Densification: which Gaussians are replaced by finer ones, and by what.
// The defaults are the published sizes.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "model/base/field_checks.h"

namespace vsplat {

struct DensifyConfig {
  int top_k = 12000;                       // number of Gaussians that are replaced: those with the largest scores
  std::vector<int> channels = {160, 256};  // width of each level; the first is that of a candidate's feature
  std::vector<int> heads = {20, 32};
  std::vector<int> depths = {2, 2};   // blocks
  std::vector<int> patch = {48, 48};  // points that attend to each other
  int mlp_ratio = 4;
  std::vector<int> upscale = {2, 4};  // children of a point
  int stride = 2;                     // factor by which the grid's cells shrink from level to level
  double non_leaf_ratio = 0.8;        // share of a level's points that continues to the next level
  int frequencies = 15;               // sine and cosine frequencies that encode an offset
  // The curves that order the points. Block i of a level takes the one that a permutation names.
  std::string orders = "z,z-trans,hilbert,hilbert-trans";
  double cell = 1.0 / 64;             // edge of the first level's cells: the backbone's voxel
  double opacity_threshold = 0.005;   // VS-Splat's candidates exceed it; LaRa's backbone has its own field
  bool residual = false;              // whether a level's attributes are added to its parents'
  std::string duplicates = "spconv";  // points in one cell: spconv, all; see model/ops/volume/cell_map.h
  bool score_through_clamp = true;    // whether the scores ignore the clamp of alpha at 0.99

  std::size_t levels() const { return channels.size(); }
  bool operator==(const DensifyConfig&) const = default;
};

// A curve by its name in `orders`.
struct CurveName {
  bool hilbert = false;
  bool exchanged = false;  // x and y
};
std::vector<CurveName> curves_of(const DensifyConfig& config);

// Error that names the field and its value.
void check(const DensifyConfig& config, const FieldChecks& is);

// Calls visit(name, field) for each, in the order above; names begin with "densify.".
template <class C, class Visit>
void each_densify_field(C& c, const Visit& visit, bool with_threshold) {
  visit("densify.top_k", c.top_k);
  visit("densify.channels", c.channels);
  visit("densify.heads", c.heads);
  visit("densify.depths", c.depths);
  visit("densify.patch", c.patch);
  visit("densify.mlp_ratio", c.mlp_ratio);
  visit("densify.upscale", c.upscale);
  visit("densify.stride", c.stride);
  visit("densify.non_leaf_ratio", c.non_leaf_ratio);
  visit("densify.frequencies", c.frequencies);
  visit("densify.orders", c.orders);
  visit("densify.cell", c.cell);
  if (with_threshold) visit("densify.opacity_threshold", c.opacity_threshold);
  visit("densify.residual", c.residual);
  visit("densify.duplicates", c.duplicates);
  visit("densify.score_through_clamp", c.score_through_clamp);
}

}  // namespace vsplat
