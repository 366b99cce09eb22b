// What changes from step to step of a training. Steps count from 1. Pure functions: safe from any thread.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

struct Schedule {
  double lr = 4e-4;        // the highest learning rate
  long warmup = 1000;      // steps of its linear rise; 0: none
  long steps = 50000;      // until it is 0 for the first time
  double tau_first = 1.0;  // temperature of the Gumbel-Sigmoid at step 1,
  double tau_last = 0.1;   // and from step 1 + tau_steps on; linear between
  long tau_steps = 50000;  // 0: tau_last from the start
  // Steps after those: each a rise and a cosine of its own, to the same highest rate. What a step before them has does
  // not depend on them.
  std::vector<long> extend = {};

  bool operator==(const Schedule&) const = default;
};

// The paper's shares of so many steps: a fiftieth of them, 1 to 1000, to warm up.
long usual_warmup(long steps);

// The same of those without the second level of LaRa's network: a tenth, 1 to 5000.
long usual_fine_after(long steps);

// Of the whole training.
long total_steps(const Schedule& schedule);

// lr * step / warmup up to step `warmup`, then half a cosine down to 0 at step `steps`; each of `extend` the same with
// its own steps and their usual_warmup(); 0 after the last. Error(internal) where step < 1.
double learning_rate(const Schedule& schedule, long step);

// Error(internal) where step < 1.
double temperature(const Schedule& schedule, long step);

// What of it does not come to its end within its steps, each in words for a warning.
std::vector<std::string> unfinished(const Schedule& schedule);

// Whether both say the same of the steps up to `step`, but for what the other fields of `steps` decide: of `extend`,
// those that have begun are equal.
bool extended_alike(const Schedule& a, const Schedule& b, long step);

}  // namespace vsplat
