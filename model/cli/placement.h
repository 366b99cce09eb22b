// Options for the place of the object and the views' pictures: what reconstruct and evaluate share.
#pragma once
#include <CLI/CLI.hpp>
#include <algorithm>
#include <string>
#include <vsplat/vsplat.hpp>

#include "arguments.h"

namespace command {

struct PlacementOptions {
  std::string center, scale, crop = "auto";
  bool auto_frame = false;
};

inline constexpr const char* placement_group = "The object's cube";

// --pictures and --skip-bad: how a list of views is read. `named`: only named views are used, so the others may be bad.
void add_view_options(CLI::App& app, std::string& pictures, bool& skip_bad);
vsplat_views_options views_options(const std::string& pictures, bool skip_bad, bool named);

void add_placement_options(CLI::App& app, PlacementOptions& options);
vsplat_crop crop_of(const PlacementOptions& options);

// Sets the fields that vsplat_input_options and vsplat_evaluate_options share.
template <class Options>
void set_placement(const PlacementOptions& from, Options& out) {
  if (!from.center.empty()) {
    const std::array<double, 3> center = triple("--center", from.center);
    out.has_center = 1;
    std::copy(center.begin(), center.end(), out.center);
  }
  if (!from.scale.empty()) out.scale = positive_number("--scale", from.scale, "edge length in world units");
  out.auto_frame = from.auto_frame;
  out.crop = crop_of(from);
}

}  // namespace command
