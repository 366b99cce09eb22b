/* Finds the fastest variants of the kernels on a device. Part of vsplat.h, which states the common conventions. */
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
  uint32_t jobs;    /* jobs whose shapes are tuned: a sum of values of vsplat_program_jobs; 0: reconstruct and render */
  int32_t full;     /* not 0: tries all combinations of values, without a time limit; 0: one parameter at a time */
  int32_t again;    /* not 0: tries again what was tried before */
  double seconds;   /* without `full`, no further set is begun after this time; 0: 50 */
  const char* path; /* where to write the table; NULL: the device's file in the cache folder, which every device opened
                       afterwards uses */
  vsplat_progress_function progress; /* the stage is what is tried next; may be NULL */
  void* user;
} vsplat_tune_options;
#define VSPLAT_TUNE_OPTIONS_INIT \
  { sizeof(vsplat_tune_options), 0, 0, 0, 0.0, NULL, NULL, NULL }

/* Searches for the fastest build and launch parameters of the kernels on that device, at the shapes that the jobs have
   with that model. Before a set of parameters may win, its results are compared with sums in double, at that shape and
   at an odd one. A set that is wrong or does not run is refused, with a warning that names it, its error and the
   expected value. A set wins if it takes 3 % less time than the best so far, timed beside it. Every finished set is
   written to the table's file at once, and the choice for a shape when all of its sets are finished: a search that ends
   early (vsplat_device_cancel included) or is killed resumes where it was. VSPLAT_ERROR_FILE: another process is
   searching. The device, opened before, keeps the table that it has. VSPLAT_TUNING in the environment is "off", or
   names a table to use instead. `options` NULL: defaults.

   `out_text` becomes JSON, to be freed with vsplat_text_free: {"device", "driver", "flavour", "path", "table": its
   hash, "" if the defaults are best, "before": the hash of the previous table, "tried", "left": sets for which there
   was no time or no memory, "seconds", "shapes": [{"op", "shape"}], the jobs' shapes, longest time first, "chosen":
   [{"op", "shape", "set", "seconds", "times_as_fast": relative to the defaults, "error"}], the last three null if the
   choice is from before and was not timed again, "refused": [{"op", "shape", "set", "verdict": "wrong" or "failed",
   "error", "why"}], "not_right": shapes for which no set is right}. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_tune(vsplat_device device, vsplat_model model,
                                                      const vsplat_tune_options* options, char** out_text);

#ifdef __cplusplus
}
#endif

#endif
