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
  vsplat_reconstruct_options run;  // but for its progress
};

// Of several ranks each takes every so manieth line, and rank 0 tells of all.
// Every object that can be reconstructed is, and its file is kept whatever becomes of the others; std::runtime_error at
// the end where there are others.
void reconstruct_list(const ListRequest& request);

}  // namespace command
