// Systems on data sets under protocols, in one table.
#pragma once
#include <string>
#include <vector>

#include "command.h"

namespace command {

struct TableOptions {
  std::string file;                  // what is measured, in JSON
  std::vector<std::string> outputs;  // files of it, by their endings: .md, .csv, .json
  bool skip_bad = false;
  bool dry_run = false;  // measures nothing: reads models and lists of objects, and plans memory
};

void evaluate_table(const Common& common, const TableOptions& options);

}  // namespace command
