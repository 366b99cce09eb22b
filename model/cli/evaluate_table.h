// Systems (models) on data sets under protocols, in one table.
#pragma once
#include <string>
#include <vector>

#include "command.h"

namespace command {

struct TableOptions {
  std::string file;                  // the request, in JSON
  std::vector<std::string> outputs;  // files to write the table to, by extension: .md, .csv, .json
  bool skip_bad = false;
  bool dry_run = false;  // measures nothing: reads models and lists of objects, and plans memory
};

void evaluate_table(const Common& common, const TableOptions& options);

}  // namespace command
