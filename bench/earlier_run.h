// A run of the benchmarks beside an earlier one, case by case.
#pragma once
#include <string>
#include <vector>

#include "bench/bench.h"

namespace vsplat::bench {

// What is looked at of a file that `vsplat bench --json` wrote.
struct EarlierCase {
  std::string suite, name;
  int number = 0;  // among cases of that name, from 0
  double median_s = 0, spread = 0, share_of_peak = 0;
};
struct EarlierReport {
  std::string path, device, driver, kernels, tuning;
  double peak_gflops = 0, peak_gbs = 0;
  std::vector<EarlierCase> cases;
};

// Error(format) that names the file and the field.
EarlierReport read_report(const std::string& path);
Comparison compare(const EarlierReport& before, const Report& now);

}  // namespace vsplat::bench
