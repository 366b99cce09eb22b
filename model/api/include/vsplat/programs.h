/* The OpenCL programs that jobs launch, for whoever compiles them elsewhere.
   Part of vsplat.h, which says what holds for all of it. */
#ifndef VSPLAT_PROGRAMS_H
#define VSPLAT_PROGRAMS_H

#include <vsplat/device.h>
#include <vsplat/model.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum vsplat_program_jobs {
  VSPLAT_PROGRAMS_OF_RECONSTRUCT = 1,
  VSPLAT_PROGRAMS_OF_RENDER = 2, /* volumes and surfels, and the gradients of drawing them */
  VSPLAT_PROGRAMS_OF_REFINE = 4,
  VSPLAT_PROGRAMS_OF_TRAIN = 8
} vsplat_program_jobs;

typedef struct vsplat_programs_options {
  size_t size;
  uint32_t jobs;                     /* the sum of values of vsplat_program_jobs */
  int32_t others;                    /* not 0: kernels of the device's flavour that none of the jobs launches, too */
  int32_t sources;                   /* not 0: with each program's text */
  int32_t build;                     /* not 0: compiles each program for the device, to tell local memory */
  vsplat_progress_function progress; /* stage "programs"; may be NULL */
  void* user;
} vsplat_programs_options;
#define VSPLAT_PROGRAMS_OPTIONS_INIT \
  { sizeof(vsplat_programs_options), 15, 1, 0, 0, NULL, NULL }

/* The OpenCL programs of jobs with that model on that device, found by planning them; nothing is launched, and without
   `build` nothing compiled. The model may be NULL where jobs are neither to reconstruct nor to train. `options` NULL:
   defaults, all jobs and all other kernels. `out_text` becomes JSON, to be freed with vsplat_text_free: {"device",
   "driver", "flavour", "allowed", "programs": [{"name", "options", "targets", "text", "kernels": [{"name", "launches":
   [{"job", "stage", "group", "local_bytes"}], "local_memory", "error"}]}]}. `allowed` is what cl/allowed.txt says;
   `targets` stands where only these vendors' compilers can read the program; `text` has includes expanded; `group` is
   the work-group's size, null where the driver chooses; `local_bytes` the local memory that is an argument of the
   launch; `local_memory` that which the kernel declares, both in bytes, or null, with `error` saying why the device's
   compiler does not take it. Kernels that nothing launches have no launches. Models of other sizes and other
   devices may have programs built with other options. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_programs(vsplat_device device, vsplat_model model,
                                                                 const vsplat_programs_options* options,
                                                                 char** out_text);

#ifdef __cplusplus
}
#endif

#endif
