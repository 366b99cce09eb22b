// Fewer Gaussians that show the same: those that share a cell of a grid become one.
#pragma once
#include <cstddef>
#include <vector>

#include "model/base/gaussians.h"

namespace vsplat {

// Volumes whose centres share a cell of a grid become one, `edge` being the cells' edge. It has their mean, covariance
// and colour, weighted by what each absorbs where it is drawn: its optical depth -ln(1 - opacity), less that of the
// faintest opacity that is drawn, times its area. Its opacity absorbs as much as all of them.
Gaussians merged_in_cells(const Gaussians& gaussians, double edge);

// As merged_in_cells(), with the smallest cells that leave at most `most`; returns them unchanged if there are no more.
// If the cells are more than `most`, those that absorb least are left out.
Gaussians merged_gaussians(const Gaussians& gaussians, std::size_t most);

// One scene of several, each of which shows the same: every opacity is lowered so that together they absorb what one of
// them does on average. All are volumes or all surfels, of one degree. At least one.
Gaussians mean_of(const std::vector<Gaussians>& scenes);

}  // namespace vsplat
