/* The time that a fit reports as left, with kernels to compile in its first steps and without. Prints every
   check that fails; exits 1 if any did. */
#include <stdlib.h>
#include <time.h>

#include "fit_setting.h"

enum { steps = 300 };

static double now(void) {
  struct timespec t;
  HOLD(clock_gettime(CLOCK_MONOTONIC, &t) == 0);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Runs all steps. Returns the seconds up to the first step that reports a time left; `first_step` is its number. */
static double hold_times(int* first_step, double* last_step) {
  static double at[steps], left[steps];
  vsplat_device device = open_device();
  vsplat_views from = make_views(device);
  vsplat_scene start = make_scene(0);
  vsplat_fit_options o = make_options(start);
  vsplat_fit fit = NULL;
  int32_t more = 1;
  int i, n = 0, first = -1;
  double begin, out;
  o.steps = steps, o.holdout = VSPLAT_HOLDOUT_NONE;
  EXPECT(VSPLAT_OK, vsplat_fit_create(device, from, &o, &fit));
  begin = now();
  while (more && n < steps && failures == 0) {
    vsplat_fit_progress progress = VSPLAT_FIT_PROGRESS_INIT;
    EXPECT(VSPLAT_OK, vsplat_fit_step(fit, &progress, &more));
    at[n] = now() - begin, left[n] = progress.seconds_left;
    ++n;
  }
  HOLD(n == steps);
  for (i = 0; i < n - 1; ++i) {
    const double is_left = at[n - 1] - at[i];
    if (!(left[i] > 0)) continue;
    if (first < 0) first = i;
    /* On a busy machine a step takes several times as long; a step that compiles takes hundreds of times as long. */
    if (left[i] > 5 * is_left + 1)
      printf("after step %d: %.2f s reported as left, %.2f s measured\n", i + 1, left[i], is_left);
    HOLD(left[i] <= 5 * is_left + 1);
  }
  HOLD(first >= 0 && first < steps / 4);
  *first_step = first + 1;
  *last_step = (at[n - 1] - at[n / 2]) / (n - 1 - n / 2);
  out = first < 0 ? 0 : at[first];
  vsplat_fit_release(fit);
  vsplat_scene_release(start);
  vsplat_views_release(from);
  vsplat_device_release(device);
  return out;
}

int main(void) {
  char caches[] = "/tmp/vsplat-pace-XXXXXX", command[128];
  double cold, warm, step;
  int first_step = 0;
  HOLD(mkdtemp(caches) != NULL);
  HOLD(setenv("VSPLAT_CACHE_DIR", caches, 1) == 0 && setenv("POCL_CACHE_DIR", caches, 1) == 0);
  cold = hold_times(&first_step, &step);
  printf("cold: %.2f s for the first %d steps, %.4f s for one of the last\n", cold, first_step, step);
  /* If compilation were counted, the reported time would exceed the limit above by far. */
  HOLD(cold / first_step * (steps - first_step) > 2 * (5 * step * (steps - first_step) + 1));
  warm = hold_times(&first_step, &step);
  printf("warm: %.2f s for the first %d steps, %.4f s for one of the last\n", warm, first_step, step);
  HOLD(warm < cold);
  snprintf(command, sizeof command, "rm -r %s", caches);
  HOLD(system(command) == 0);
  return failures == 0 ? 0 : 1;
}
