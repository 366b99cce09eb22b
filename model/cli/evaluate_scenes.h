// Scenes measured on held-out photographs of several sets, in one table.
#pragma once
#include <string>
#include <vector>

#include "command.h"

namespace command {

struct ScenesOptions {
  std::string file;                  // the list of sets, in JSON
  std::string lpips;                 // folder of LPIPS' weights, or ""
  std::vector<std::string> outputs;  // files to write the table to, by extension: .md, .csv, .json
  bool dry_run = false;              // only reads the list and its views
};

// A set that fails is reported, and the others are measured; throws std::runtime_error at the end.
void evaluate_scenes(const Common& common, const ScenesOptions& options);

}  // namespace command
