// Many objects: a list of views, each reconstructed into a scene file, by one or several devices.
#pragma once
#include <string>
#include <vsplat/vsplat.hpp>

#include "command.h"

namespace command {

struct ListRequest {
  Common& common;
  std::string list, model;  // `list` may be "-"
  vsplat_views_options views;
  std::string output;  // a folder
  bool skip_existing;
  const vsplat_input_options& input;
  vsplat_reconstruct_options run;  // except its progress
};

// With n ranks, each takes every n-th line, and rank 0 reports on all. Reconstructs every object that it can, and keeps
// its file whatever happens to the others; throws std::runtime_error at the end if any failed.
void reconstruct_list(const ListRequest& request);

}  // namespace command
