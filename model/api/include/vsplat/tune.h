/* Finding out which of the kernels' variants are fastest on a device.
   Part of vsplat.h, which says what holds for all of it. */
#ifndef VSPLAT_TUNE_H
#define VSPLAT_TUNE_H

#include <vsplat/device.h>
#include <vsplat/model.h>
#include <vsplat/programs.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct vsplat_tune_options {
  size_t size;
  uint32_t jobs;    /* whose shapes: the sum of values of vsplat_program_jobs; 0: reconstruct and render */
  int32_t full;     /* not 0: all combinations of values, for as long as it takes; 0: one parameter at a time */
  int32_t again;    /* not 0: what was tried before is tried anew */
  double seconds;   /* after which no other set is begun where it is not full; 0: 50 */
  const char* path; /* where the table goes; NULL: the device's in the cache's folder, which every device opened
                       after that uses */
  vsplat_progress_function progress; /* the stage is what is tried next; may be NULL */
  void* user;
} vsplat_tune_options;
#define VSPLAT_TUNE_OPTIONS_INIT \
  { sizeof(vsplat_tune_options), 0, 0, 0, 0.0, NULL, NULL, NULL }

/* Searches the parameters that kernels are built and launched with, at the shapes that jobs have with that model, for
   those that are fastest on that device. Each set is held against sums in double before it may win, at that shape and
   at an odd one; what is wrong or does not run is refused, with a warning that names it, its error and what was
   expected. A set wins that takes 3 % less than the best so far beside it. Each set that is done is in the table's file
   at once, whole, and what is chosen for a shape when all of its sets are: a search that ends early, by
   vsplat_device_cancel, too, or is killed, goes on where it was. VSPLAT_ERROR_FILE where another process searches. The
   device, opened before, goes on with the table that it has; VSPLAT_TUNING in the environment is "off",
   or names a table to use instead. `options` NULL: defaults.
   `out_text` becomes JSON, to be freed with vsplat_text_free: {"device", "driver", "flavour", "path", "table": its
   hash, "" where the defaults are best, "before": that of the table that was there, "tried", "left": sets that there
   was no time or no memory for, "seconds", "shapes": [{"op", "shape"}], what the jobs have, what takes longest first, "chosen": [{"op",
   "shape", "set", "seconds", "times_as_fast": as the defaults, "error"}], these three null where it is chosen from before
   and was not timed anew, "refused": [{"op", "shape", "set", "verdict":
   "wrong" or "failed", "error", "why"}], "not_right": shapes of which no set is right}. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_tune(vsplat_device device, vsplat_model model,
                                                      const vsplat_tune_options* options, char** out_text);

#ifdef __cplusplus
}
#endif

#endif
