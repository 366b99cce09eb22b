/* Pictures in, a scene out; what that prepares, and what it needs.
   Part of vsplat.h, which says what holds for all of it. */
#ifndef VSPLAT_RECONSTRUCT_H
#define VSPLAT_RECONSTRUCT_H

#include <vsplat/device.h>
#include <vsplat/model.h>
#include <vsplat/scene.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The share of the voxels, of LaRa's and GenDen's networks that of the primitives, that a reconstruction takes for
   selected where nothing else is said. */
#define VSPLAT_ASSUME_SELECTED 0.1

typedef struct vsplat_reconstruct_options {
  size_t size;
  const int32_t* voxels; /* [num_voxels] a list, ascending, that replaces the network's selection; NULL: none */
  size_t num_voxels;
  const char* selection; /* the same from a file; NULL: none */
  int32_t has_seed; /* 1: the selection is drawn with noise from `seed`; of GenDen's network: the order of curves */
  uint64_t seed;
  double near_plane; /* of the scene, world units; 0: 0.2 times the cube's edge */
  const char* dump;  /* a folder: every stage in its stages.safetensors; NULL: none */
  /* Share of the voxels for which a run that does not fit is refused beforehand; 0: VSPLAT_ASSUME_SELECTED. */
  double assume_selected;
  vsplat_progress_function progress; /* may be NULL */
  void* user;
  double up[3]; /* which way is up in the world, for the scene to tell; 0, 0, 0: the input's (vsplat_input_info) */
} vsplat_reconstruct_options;
#define VSPLAT_RECONSTRUCT_OPTIONS_INIT                                                              \
  {                                                                                                  \
    sizeof(vsplat_reconstruct_options), NULL, 0, NULL, 0, 0, 0.0, NULL, 0.0, NULL, NULL, { 0, 0, 0 } \
  }

/* One forward pass. The scene is in the frame of the input's cameras. With no voxel selected it is empty: not an error.
   The model's weights stay on the device until model or device go. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_reconstruct(vsplat_device device, vsplat_model model,
                                                             vsplat_input input,
                                                             const vsplat_reconstruct_options* options,
                                                             vsplat_scene* out_scene);

typedef struct vsplat_prepare_options {
  size_t size;
  int32_t views; /* that a reconstruction will have; 0: as many as the model is trained with */
  int32_t
      launch; /* not 0: reconstructs grey pictures and draws what comes of it, too: for drivers that compile a kernel
                     where it is first launched. Takes the time of a reconstruction beside that */
  vsplat_progress_function progress; /* stages "weights", "compile" and "launch"; may be NULL */
  void* user;
} vsplat_prepare_options;
#define VSPLAT_PREPARE_OPTIONS_INIT \
  { sizeof(vsplat_prepare_options), 0, 0, NULL, NULL }

/* Does ahead what the first reconstruction with the model and its drawing would do once: puts the weights on the device
   and compiles every program that they take. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_prepare(vsplat_device device, vsplat_model model,
                                                                const vsplat_prepare_options* options);

/* What a computation will need. */
typedef struct vsplat_stage_memory {
  char stage[32];
  uint64_t reserved; /* bytes of device memory that are held when the stage needs most */
  uint64_t live;     /* bytes of them in use */
} vsplat_stage_memory;

#define VSPLAT_MAX_STAGES 32
typedef struct vsplat_plan {
  size_t size;
  uint64_t peak;  /* bytes */
  uint64_t limit; /* bytes that may be used */
  int32_t fits;   /* 1: peak <= limit, and no buffer exceeds the device's largest */
  uint32_t num_stages;
  vsplat_stage_memory stages[VSPLAT_MAX_STAGES];
  uint64_t host_peak;  /* bytes of the host's memory beside them: results, pictures; 0: little */
  uint64_t host_limit; /* of vsplat_set_host_memory. `fits` looks at it, too; where the device is a CPU, at the sum */
} vsplat_plan;
#define VSPLAT_PLAN_INIT \
  { sizeof(vsplat_plan), 0, 0, 0, 0, {{"", 0, 0}}, 0, 0 }

/* Memory of vsplat_reconstruct for `views` views with that share of the voxels selected (1: the hard bound), without
   computing anything. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_plan_reconstruct(vsplat_device device, vsplat_model model,
                                                                  int32_t views, double selected,
                                                                  vsplat_plan* out_plan);

#ifdef __cplusplus
}
#endif

#endif
