// A training step: its objects, and what it reports.
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "model/data/training_views.h"

namespace vsplat {

// One object of a step. `noise`, unless null, replaces the seed's noise: [R^3], logistic. `selection` replaces the
// selected voxels: ascending.
struct StepItem {
  const TrainingViews* views = nullptr;
  std::array<float, 3> input_background{1, 1, 1};  // background of the input views; their pictures already have it
  const std::vector<float>* noise = nullptr;
  const std::vector<int>* selection = nullptr;
};

// Means over a step's objects, unless stated otherwise.
struct StepReport {
  long step = 0;                   // from 1
  double lr = 0, temperature = 0;  // of this step
  double loss = 0;                 // of both levels, and of predicted rays
  // from the mean squared error over novel views, or over input views if there are no others; both are equal if
  // `levels` is "coarse"
  double psnr = 0, psnr_coarse = 0;
  double selected = 0;              // share of the candidates that the network selects: voxels, or LaRa's primitives
  double gradient_norm = 0;         // before clipping
  std::uint64_t intersections = 0;  // maximum over pictures
  long most_selected = 0;           // maximum over objects
};

// Results of a shard: sums over its objects, each weighted by its share of the step.
struct ShardSums {
  StepReport report;  // without its PSNR
  double mse = 0, mse_coarse = 0;
  void add(const ShardSums& next);
  StepReport means() const;
};

}  // namespace vsplat
