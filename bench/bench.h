// What `vsplat bench` runs: cases with the network's real shapes, each checked against a reference on the host before
// it is timed, beside the device's limits, measured in the same run.
//   bench::Report report = bench::run(ctx, {{"gemm", "conv"}});
//   fmt::print("{}", bench::table(report));   // or bench::json(report)
#pragma once
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "runtime/context.h"

namespace vsplat::bench {

// A case that is ready to run, its data on the device.
struct Prepared {
  Cost cost;                   // of one run, by the definition of what is computed
  double performed_flops = 0;  // where the method gets by with fewer: held against the peak (0: cost.flops)
  bool memory_bound = false;   // which of the two peaks it is held against
  std::function<void()> run;   // enqueues one run
  std::function<double()>
      error;  // after a run: the worst error, relative to the largest value (on a sample of outputs)
  double tolerance = 1e-4;
  // Other libraries at the same task: name -> one run.
  std::map<std::string, std::function<void()>> references;
};

struct Case {
  std::string name;
  std::function<Prepared(Context&)> prepare;
};

struct Options {
  std::vector<std::string> suites;  // of suite_names(); empty: all
  std::string filter;               // only cases whose "suite/name" contains this
  double seconds = 1.0;             // spent on timing each case, at the least three runs
  bool references = false;          // time other libraries, too (CLBlast compiles for ten seconds on a CPU)
  std::function<void(const std::string&)> on_case;  // called before each
};

struct Result {
  std::string suite, name, kind;  // kind: "compute" or "memory"
  double median_s = 0;
  double spread = 0;            // (third quartile - first) / median
  double gflops = 0, gbs = 0;   // of the definition's cost
  double performed_gflops = 0;  // of what the method computes
  double share_of_peak = 0;     // of performed_gflops or gbs, by kind
  double error = 0;
  std::map<std::string, double> reference;  // library -> median seconds
};

struct Report {
  std::string device, driver, kernels;
  double peak_gflops = 0;  // independent multiply-adds
  double peak_gbs = 0;     // y = a + s b
  std::vector<Result> results;
};

std::vector<std::string> suite_names();
// Throws Error(usage) for an unknown suite, Error(internal) where a case's result is wrong.
Report run(Context& ctx, const Options& options);
std::string table(const Report& report);
std::string json(const Report& report);

// The suites.
std::vector<Case> gemm_cases();
std::vector<Case> conv_cases();

}  // namespace vsplat::bench
