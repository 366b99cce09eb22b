// The options of `vsplat bench`: the command describes and checks them, the program vsplat-bench obeys them.
#pragma once
#include <string>
#include <vector>

#include "command.h"

namespace command {

struct BenchOptions {
  Common common;
  std::vector<std::string> suites;
  std::string filter;
  double seconds = 1.0;
  bool references = false;
  std::string scenes;
  std::string model, cameras, selection;
  std::string compare, fail_above;
};

// What can be asked for, in the order in which it runs.
std::vector<std::string> bench_suites();

// Adds the sub-command with its options, but does not say what it does. `options` has to outlive `app`.
CLI::App* add_bench_options(CLI::App& app, BenchOptions& options);

}  // namespace command
