// Runs timed by turns, so that what else the machine does meets all of them alike.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "runtime/context.h"

namespace vsplat::bench {

struct Times {
  double median = 0, spread = 0, least = 0;
  double mean = 0;  // over the inputs, of each one's median
};

struct Timed {
  std::function<void()> run;
  int inputs = 1;  // run() goes through so many in turn
};

struct TimingOptions {
  double seconds = 1.0;  // for each; 0: one run of each input
  // From round 1 on, with the seconds that are left as the rounds before let expect, below 0 before the first; may
  // throw to stop.
  std::function<void(int round, double left_s)> before_round;
};

// One round after the other runs each with every input: three or more, and as many as `seconds` allow each on average,
// but no more than 30 times that long. The first run with each input, which compiles and allocates, is not counted,
// unless `warm` says that it was made.
std::vector<Times> time_by_turns(Context& ctx, const std::vector<Timed>& all, const TimingOptions& options, bool warm);

double seconds_of(Context& ctx, const std::function<void()>& run);

}  // namespace vsplat::bench
