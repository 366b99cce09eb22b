// A training's sheets, read to be part of a page.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace vsplat {

struct RunSheet {
  std::size_t stage = 0;  // which of the folders it is of
  long step = 0;
  std::string base64;  // the PNG
};

struct RunSheets {
  std::vector<RunSheet> sheets;  // by stage and step
  std::size_t left_out = 0;      // for their size, or since they cannot be read
};

// Of the folders' sheets/step-*.png as many as have 12 MiB together, spread evenly with the last among them. Links are
// not followed: what lies elsewhere is none of the run's.
RunSheets read_run_sheets(const std::vector<std::filesystem::path>& folders);

}  // namespace vsplat
