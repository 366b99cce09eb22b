/* The OpenCL programs that jobs launch, for compiling them elsewhere. Part of vsplat.h, which states the common
   conventions. */
#ifndef VSPLAT_PROGRAMS_H
#define VSPLAT_PROGRAMS_H

#include <vsplat/device.h>
#include <vsplat/model.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum vsplat_program_jobs {
  VSPLAT_PROGRAMS_OF_RECONSTRUCT = 1,
  VSPLAT_PROGRAMS_OF_RENDER = 2, /* volumes and surfels, and their gradients */
  VSPLAT_PROGRAMS_OF_FIT = 4,
  VSPLAT_PROGRAMS_OF_TRAIN = 8
} vsplat_program_jobs;

typedef struct vsplat_programs_options {
  size_t size;
  uint32_t jobs;                     /* sum of values of vsplat_program_jobs */
  int32_t others;                    /* not 0: also kernels of the device's flavour that none of the jobs launches */
  int32_t sources;                   /* not 0: includes each program's source */
  int32_t build;                     /* not 0: compiles each program for the device, to find its local memory */
  vsplat_progress_function progress; /* stage "programs"; may be NULL */
  void* user;
} vsplat_programs_options;
#define VSPLAT_PROGRAMS_OPTIONS_INIT \
  { sizeof(vsplat_programs_options), 15, 1, 0, 0, NULL, NULL }

/* Lists the OpenCL programs of these jobs with that model on that device, by planning the jobs. Launches nothing, and
   without `build` compiles nothing. The model may be NULL if no job reconstructs or trains. `options` NULL: defaults,
   all jobs and all other kernels. `out_text` becomes JSON, to be freed with vsplat_text_free: {"device", "driver",
   "flavour", "allowed", "programs": [{"name", "options", "targets", "text", "kernels": [{"name", "launches": [{"job",
   "stage", "group", "local_bytes"}], "local_memory", "error"}]}]}. `allowed` is the content of cl/allowed.txt.
   `targets` is present if only these vendors' compilers can read the program. `text` has its includes expanded. `group`
   is the work-group size, null if the driver chooses it. `local_bytes` is the local memory passed as an argument of the
   launch; `local_memory` is what the kernel declares; both are in bytes. `local_memory` is null if the device's
   compiler rejects the program, and `error` says why. Kernels that nothing launches have no launches. Models of other
   sizes and other devices may need programs built with other options. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_programs(vsplat_device device, vsplat_model model,
                                                                 const vsplat_programs_options* options,
                                                                 char** out_text);

#ifdef __cplusplus
}
#endif

#endif
