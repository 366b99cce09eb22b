// What `vsplat bench` runs: the network's real shapes and scenes to draw, each checked against a reference on the host
// before it is timed, and every single operation (bench/ops/), beside the device's limits, measured in the same run.
//   bench::Report report = bench::run(ctx, {{"gemm", "render"}});
//   fmt::print("{}", bench::table(report));   // or bench::json(report)
#pragma once
#include <fmt/format.h>

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "runtime/context.h"

namespace vsplat::bench {

// A single kernel, named by the peak that it is compared with, or a whole pass of many: drawing, training, fitting, or
// a network. After timing an operation becomes compute or memory, by the peak that it is nearer to.
enum class Kind { compute, memory, operation, forward, backward, training, fitting, network };
const char* name_of(Kind kind);
inline bool is_pass(Kind kind) { return kind >= Kind::forward; }

// Another library doing the same task, or its part of the task (references.h).
struct Reference {
  std::function<void()> run;      // until it is done
  std::function<double()> error;  // after a run, as Prepared has it; none: not looked at
};

// A case that is ready to run, its data on the device.
struct Prepared {
  Kind kind = Kind::compute;
  // Cost of one run, by definition. A pass and an operation cost the average of what their launches state.
  Cost cost;
  double performed_flops = 0;  // operations of a method that needs fewer; compared with the peak (0: cost.flops)
  int inputs = 1;              // number of inputs that run() uses in turn
  std::function<void()> run;   // enqueues one run
  std::function<double()>
      error;  // after a run: the worst error, relative to the largest value (on a sample of outputs)
  double tolerance = 1e-4;
  std::function<bool()> look;  // of an operation: whether there are numbers, not zeros throughout; `error` may be none
  std::map<std::string, Reference> references;            // by the libraries' names
  std::function<std::map<std::string, double>()> others;  // median seconds of other programs at the same task, or none
};

struct Case {
  std::string name;
  std::function<Prepared(Context&)> prepare;
};

// What is going on, and how long it will: before each case and each of its runs.
struct CaseProgress {
  std::string name, doing;      // "conv3d/24.128-256", "run 3"
  std::size_t at = 0, all = 0;  // this case is number `at` (from 0) of so many
  double left_s = -1;           // seconds until all is done, as the cases before let expect; below 0: none was yet
};

struct Options {
  std::vector<std::string> suites;  // of suite_names(); empty: all
  std::string filter;               // only cases whose "suite/name" contains this
  double seconds = 1.0;             // spent on timing each case: three runs or more, unless they take 30 times as long
  bool references = false;          // time other libraries, too (CLBlast compiles for ten seconds on a CPU)
  std::string scenes;               // a folder with NAME.ply and NAME.cameras.json to draw; empty: scenes made here
  // What is trained; empty: random weights of the size "small", drawn pictures, a shell of a tenth of the voxels.
  std::string model;      // a model file
  std::string cameras;    // four views with pictures of the model's size, in the object's frame (its cube 0,0,0 / 1)
  std::string selection;  // a file of voxel indices
  std::function<void(const CaseProgress&)> on_progress;  // may throw to stop
};

// What one kernel does in a run of a pass.
struct KernelTime {
  std::string stage, name;
  double calls = 0, seconds = 0, gflops = 0, gbs = 0;
  double performed_gflops = 0;  // of what the method computes
};

// A stage of a network, against what its launches could be done in: each of its kernels by the peak that is nearer.
struct StageTime {
  std::string name;
  double seconds = 0, limit_s = 0;
  double gflops = 0, performed_gflops = 0, gbs = 0;
  Kind limit = Kind::compute;  // or memory: of which most of limit_s is
};

struct Result {
  std::string suite, name;
  Kind kind = Kind::compute;
  double median_s = 0, least_s = 0;
  double spread = 0;            // (third quartile - first) / median, of times over the median of the same input
  double gflops = 0, gbs = 0;   // of the definition's cost
  double performed_gflops = 0;  // of what the method computes
  double share_of_peak = 0;     // of performed_gflops or gbs, by kind; for a pass the larger of both
  std::optional<double> error;  // none where the result is only looked at
  std::map<std::string, double> reference;  // library -> median seconds
  std::map<std::string, double> stages;     // of a pass: shares of its time, "host" is what no kernel accounts for
  std::vector<KernelTime> kernels;          // of a network and a step of training or fitting, most time first
  std::vector<StageTime> by_stage;          // of a network, most time first
};

// A case beside an earlier run of it: slower or faster where the medians differ by more than the noise, which is the
// larger of both spreads, and 3 % at the least.
struct ComparedCase {
  std::string suite, name, verdict;  // slower, faster, same, new
  double before_s = 0, after_s = 0, slower_by = 0, noise = 0;
  double before_share = 0, after_share = 0;  // of the peaks of either run
};
struct Comparison {
  std::string file;
  std::vector<std::string> differ;  // what else is not as it was
  std::vector<ComparedCase> cases;
  std::size_t not_run = 0;  // cases that there were, and now are not
};

struct Report {
  std::string device, driver, kernels;
  std::string tuning;  // the hash of the table of tuned parameters; empty: none
  std::string precision;
  double peak_gflops = 0;  // independent multiply-adds
  double peak_gbs = 0;     // y = a + s b
  std::string references;  // what was timed beside ours, or why it was not; empty where it was not asked for
  std::vector<Result> results;
  std::optional<Comparison> compared;
};

std::vector<std::string> suite_names();
std::vector<std::string> operation_names();  // of them, those of bench/ops/: by the headers of model/ops/
// Throws Error(usage) for an unknown suite, Error(internal) where a case's result is wrong.
Report run(Context& ctx, const Options& options);
std::string table(const Report& report);
std::string json(const Report& report);

// A profile of the whole of it: from record() until recorded(), as profiles are written.
void record(Context& ctx);
struct Recorded {
  std::string json, page, trace;
};
Recorded recorded(Context& ctx);

// A suite: NAME.cpp or ops/NAME.cpp, which defines NAME_cases(). CMake lists them.
struct Suite {
  const char* name;
  std::vector<Case> (*cases)(const Options&);
};
std::vector<Suite> suites();            // whole passes, and dense kernels at the network's shapes
std::vector<Suite> operation_suites();  // single operations, by the headers of model/ops/

}  // namespace vsplat::bench
