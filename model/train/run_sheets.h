// Reads a training's sheets for a page.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

namespace vsplat {

struct RunSheet {
  std::size_t stage = 0;  // index of its folder
  long step = 0;
  std::string base64;  // PNG
};

struct RunSheets {
  std::vector<RunSheet> sheets;  // by stage and step
  std::size_t left_out = 0;      // too large, or unreadable
};

// Reads the folders' sheets/step-*.png up to 12 MiB in total. Beyond that it takes a subset that is spread evenly and
// includes the last sheet. Does not follow links, which may point out of the run.
RunSheets read_run_sheets(const std::vector<std::filesystem::path>& folders);

}  // namespace vsplat
