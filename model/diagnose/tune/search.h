// The search for a device's fastest parameters: each set is held against sums in double before it may win, and is timed
// beside the best so far, by turns, so that other load on the machine takes from both.
#pragma once
#include <functional>
#include <optional>
#include <string>

#include "runtime/context.h"

namespace vsplat {

struct TuneRequest {
  NotedShapes shapes;
  // All combinations of values, for as long as it takes; else one parameter at a time, the shapes that take longest
  // first, and no set is begun after `seconds`.
  bool full = false;
  double seconds = 50;
  bool again = false;  // what was tried before of these shapes is tried anew; a choice stays until another wins
  std::string path;    // the table; empty: the device's in the cache's folder
  // What is tried next, and how much is done, from 0 to 1. False: stop.
  std::function<bool(const std::string&, double)> progress;
};

struct TuneResult {
  std::string path;
  TuningTable table;
  std::string before;        // the hash of the table that was there
  long tried = 0, left = 0;  // sets, now; and those that there was no time or no memory for
  double seconds = 0;
  std::vector<TunedShape> shapes;      // classes of what the jobs have, what takes longest first
  std::vector<std::string> not_right;  // shapes of which no set was right
};

// What is tried is in the table's file at once, whole, and what is chosen for a shape when its search has ended: one
// that is stopped, by what stops `ctx`, too, or killed goes on from there. Contexts that are made after it use the
// table. What wins is told in the log; what is wrong, does not run or has no room is a warning.
// Error(usage) where there is no path, Error(file) where it cannot be written or another search does.
TuneResult tune(Context& ctx, const TuneRequest& request);

// Tries one set: the error of what it computes at that shape, and at an odd one, by each case's tolerance; more than
// 1 is wrong. For tests of all that the search may choose.
double error_of(Context& ctx, const TunedShape& shape, const TunedValues& values);

// As the library tells of a search: JSON.
std::string tune_json(const Context& ctx, const TuneResult& result);

}  // namespace vsplat
