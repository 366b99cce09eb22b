// What `vsplat bench` runs: the network's real shapes and scenes to draw, each checked against a reference on the host
// before it is timed, beside the device's limits, measured in the same run.
//   bench::Report report = bench::run(ctx, {{"gemm", "render"}});
//   fmt::print("{}", bench::table(report));   // or bench::json(report)
#pragma once
#include <fmt/format.h>

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "runtime/context.h"

namespace vsplat::bench {

// A single kernel, named by the peak that it is held against, or a whole pass of many: of drawing, of
// training, or of refinement.
enum class Kind { compute, memory, forward, backward, training, fitting };
const char* name_of(Kind kind);
inline bool is_pass(Kind kind) { return kind != Kind::compute && kind != Kind::memory; }

// A case that is ready to run, its data on the device.
struct Prepared {
  Kind kind = Kind::compute;
  Cost cost;  // of one run, by the definition of what is computed; a pass costs what its launches say, on average
  double performed_flops = 0;  // where the method gets by with fewer: held against the peak (0: cost.flops)
  int inputs = 1;              // run() goes through so many in turn
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
  std::string scenes;               // a folder with NAME.ply and NAME.cameras.json to draw; empty: scenes made here
  // What is trained; empty: random weights of the size "small", drawn pictures, a shell of a tenth of the voxels.
  std::string model;      // a model file
  std::string cameras;    // four views with pictures of the model's size, in the object's frame (its cube 0,0,0 / 1)
  std::string selection;  // a file of voxel indices
  std::function<void(const std::string&)> on_case;  // called before each
};

// What one kernel does in a run of a pass.
struct KernelTime {
  std::string stage, name;
  double calls = 0, seconds = 0, gflops = 0, gbs = 0;
};

struct Result {
  std::string suite, name;
  Kind kind = Kind::compute;
  double median_s = 0;
  double spread = 0;            // (third quartile - first) / median, of times over the median of the same input
  double gflops = 0, gbs = 0;   // of the definition's cost
  double performed_gflops = 0;  // of what the method computes
  double share_of_peak = 0;     // of performed_gflops or gbs, by kind; for a pass the larger of both
  double error = 0;
  std::map<std::string, double> reference;  // library -> median seconds
  std::map<std::string, double> stages;     // of a pass: shares of its time, "host" is what no kernel accounts for
  std::vector<KernelTime> kernels;          // of a step of training or refinement, most time first
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
std::vector<Case> gemm_cases(const Options& options);
std::vector<Case> conv_cases(const Options& options);
std::vector<Case> render_cases(const Options& options);
std::vector<Case> train_cases(const Options& options);
std::vector<Case> refine_cases(const Options& options);

}  // namespace vsplat::bench
