// What changes from step to step of a training. Steps count from 1. Pure functions: safe from any thread.
#pragma once

namespace vsplat {

struct Schedule {
  double lr = 4e-4;        // the highest learning rate
  long warmup = 1000;      // steps of its linear rise; 0: none
  long steps = 50000;      // of the whole training
  double tau_first = 1.0;  // temperature of the Gumbel-Sigmoid at step 1,
  double tau_last = 0.1;   // and from step 1 + tau_steps on; linear between
  long tau_steps = 50000;  // 0: tau_last from the start

  bool operator==(const Schedule&) const = default;
};

// lr * step / warmup up to step `warmup`, then half a cosine down to 0 at step `steps`; 0 from there on.
// Error(internal) where step < 1.
double learning_rate(const Schedule& schedule, long step);

// Error(internal) where step < 1.
double temperature(const Schedule& schedule, long step);

}  // namespace vsplat
