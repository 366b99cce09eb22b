// Hyperparameters that change from step to step. Steps count from 1. Pure functions, which any thread may call.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

struct Schedule {
  double lr = 4e-4;        // peak learning rate
  long warmup = 1000;      // steps of the linear warm-up; 0: none
  long steps = 50000;      // until the rate reaches 0 for the first time
  double tau_first = 1.0;  // temperature of the Gumbel-Sigmoid at step 1,
  double tau_last = 0.1;   // and from step 1 + tau_steps on; linear in between
  long tau_steps = 50000;  // 0: tau_last from the start
  // Numbers of additional steps. Each extension has its own warm-up and cosine, with the same peak rate. Earlier steps
  // do not depend on them.
  std::vector<long> extend = {};

  bool operator==(const Schedule&) const = default;
};

// Default warm-up: a fiftieth of the steps, 1 to 1000, as in the paper.
long usual_warmup(long steps);

// Default number of steps without the second level of LaRa's network: a tenth of the steps, 1 to 5000.
long usual_fine_after(long steps);

// Number of steps of the whole training, extensions included.
long total_steps(const Schedule& schedule);

// Warm-up lr * step / warmup up to step `warmup`, then half a cosine down to 0 at step `steps`. Each of `extend`
// repeats this with its own steps and their usual_warmup(). 0 after the last step. Error(internal) if step < 1.
double learning_rate(const Schedule& schedule, long step);

// Temperature of the Gumbel-Sigmoid. Error(internal) if step < 1.
double temperature(const Schedule& schedule, long step);

// Describes the schedules that do not finish within the training's steps, each as the text of a warning.
std::vector<std::string> unfinished(const Schedule& schedule);

// Whether the extensions that have begun before `step` are equal in both. Ignores the other fields.
bool extended_alike(const Schedule& a, const Schedule& b, long step);

}  // namespace vsplat
