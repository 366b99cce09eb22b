// Searches a device's fastest parameters. Each set is first checked against sums in double, and then timed alternately
// with the best so far, so that other load on the machine affects both.
#pragma once
#include <functional>
#include <optional>
#include <string>

#include "runtime/context.h"

namespace vsplat {

struct TuneRequest {
  NotedShapes shapes;
  // true: all combinations of values, however long it takes. false: one parameter at a time, starting with the shapes
  // that take longest; no set starts after `seconds`.
  bool full = false;
  double seconds = 50;
  bool again = false;  // retry sets that were tried before; a choice stays until another one wins
  std::string path;    // the table; empty: the device's table in the cache folder
  // Receives what is tried next, and the share that is done, from 0 to 1. Returns false to stop.
  std::function<bool(const std::string&, double)> progress;
};

struct TuneResult {
  std::string path;
  TuningTable table;
  std::string before;        // hash of the previous table
  long tried = 0, left = 0;  // sets tried now; and sets left for lack of time or memory
  double seconds = 0;
  std::vector<TunedShape> shapes;      // classes of the jobs' shapes, slowest first
  std::vector<std::string> not_right;  // shapes for which no set was right
};

// Each trial is written to the table's file immediately and atomically, and a shape's choice when its search has ended.
// A search that is stopped, also by what stops `ctx`, or killed continues from there. Contexts made later use the
// table. Winners are logged; sets that are wrong, do not run or lack memory are warnings. Error(usage) if there is no
// path, Error(file) if it cannot be written or another search holds it.
TuneResult tune(Context& ctx, const TuneRequest& request);

// Tries one set: returns the error of its results at that shape and at an odd one, relative to each case's tolerance;
// more than 1 is wrong. For tests of all sets that the search may choose.
double error_of(Context& ctx, const TunedShape& shape, const TunedValues& values);

// The JSON report of a search.
std::string tune_json(const Context& ctx, const TuneResult& result);

}  // namespace vsplat
