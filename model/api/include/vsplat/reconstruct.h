/* Reconstruction: pictures in, a scene out; preparing for it, and planning its memory. Part of vsplat.h, which states
   the common conventions. */
#ifndef VSPLAT_RECONSTRUCT_H
#define VSPLAT_RECONSTRUCT_H

#include <vsplat/device.h>
#include <vsplat/model.h>
#include <vsplat/scene.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Default of assume_selected: the share of the voxels (LaRa and GenDen: of the primitives) that a reconstruction is
   assumed to select. */
#define VSPLAT_ASSUME_SELECTED 0.1

typedef struct vsplat_reconstruct_options {
  size_t size;
  const int32_t* voxels; /* [num_voxels] ascending list that replaces the network's selection; NULL: none */
  size_t num_voxels;
  const char* selection; /* such a list in a file; NULL: none */
  int32_t has_seed;      /* 1: the selection is drawn with noise from `seed`; GenDen: the order of curves */
  uint64_t seed;
  double near_plane; /* of the scene, in world units; 0: 0.2 times the cube's edge */
  const char* dump;  /* folder that receives every stage's tensors, in stages.safetensors; NULL: none */
  /* Share of voxels selected that the memory check before a run assumes; 0: VSPLAT_ASSUME_SELECTED. */
  double assume_selected;
  vsplat_progress_function progress; /* may be NULL */
  void* user;
  double up[3];   /* up direction in the world, stored in the scene; 0, 0, 0: the input's (vsplat_input_info) */
  int32_t passes; /* forward passes, each with another view as the reference, 1 to 16, at most one for each view;
                     0: the model's (vsplat_model_info), or 1 with a selection or a dump */
  /* Gaussians whose centres share a cell of this edge become one; in voxels, at most 16. 0: the model's; below 0: all
     stay. Surfels always stay. */
  double merge_cell;
  /* Epochs of the fit of the network's Gaussians to the input pictures, at most 1000; in each, every picture gets a
     step. 0: the model's, or none with a dump; below 0: none. */
  int32_t fit_epochs;
} vsplat_reconstruct_options;
#define VSPLAT_RECONSTRUCT_OPTIONS_INIT \
  { sizeof(vsplat_reconstruct_options), NULL, 0, NULL, 0, 0, 0.0, NULL, 0.0, NULL, NULL, {0, 0, 0}, 0, 0.0, 0 }

/* Runs the network, and fits what it makes to the input pictures. The scene is in the frame of the input's cameras.
   Several passes err differently, so that their mean is better than each: the scene holds the Gaussians of all, with
   opacities that show that mean, and merged if that is asked for. If no voxel is selected, the scene is empty; this is
   not an error. The model's weights stay on the device until the model or the device is freed. `options` NULL:
   defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_reconstruct(vsplat_device device, vsplat_model model,
                                                             vsplat_input input,
                                                             const vsplat_reconstruct_options* options,
                                                             vsplat_scene* out_scene);

typedef struct vsplat_prepare_options {
  size_t size;
  int32_t views; /* number of views of the reconstruction; 0: the number that the model is trained with */
  int32_t
      launch; /* not 0: also reconstructs grey pictures and draws the result, for drivers that compile a kernel at its
                 first launch. Takes the time of a reconstruction in addition */
  vsplat_progress_function progress; /* stages "weights", "compile" and "launch"; may be NULL */
  void* user;
} vsplat_prepare_options;
#define VSPLAT_PREPARE_OPTIONS_INIT \
  { sizeof(vsplat_prepare_options), 0, 0, NULL, NULL }

/* Does in advance what the first reconstruction with the model and the drawing of its scene would do once: uploads the
   weights and compiles every program needed. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_device_prepare(vsplat_device device, vsplat_model model,
                                                                const vsplat_prepare_options* options);

/* Memory that a computation will need. */
typedef struct vsplat_stage_memory {
  char stage[32];
  uint64_t reserved; /* bytes of device memory held when the stage needs most */
  uint64_t live;     /* bytes of those in use */
} vsplat_stage_memory;

#define VSPLAT_MAX_STAGES 32
typedef struct vsplat_plan {
  size_t size;
  uint64_t peak;  /* bytes, the most held */
  uint64_t limit; /* bytes available */
  int32_t fits;   /* 1: peak <= limit, and no buffer exceeds the device's largest */
  uint32_t num_stages;
  vsplat_stage_memory stages[VSPLAT_MAX_STAGES];
  uint64_t host_peak;  /* bytes of host memory in addition: results, pictures; 0: little */
  uint64_t host_limit; /* limit of vsplat_set_host_memory. `fits` checks it too; if the device is a CPU, it checks the
                          sum */
} vsplat_plan;
#define VSPLAT_PLAN_INIT \
  { sizeof(vsplat_plan), 0, 0, 0, 0, {{"", 0, 0}}, 0, 0 }

/* Plans the memory of vsplat_reconstruct for `views` views with that share of the voxels selected (1: the hard bound),
   without computing anything. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_plan_reconstruct(vsplat_device device, vsplat_model model,
                                                                  int32_t views, double selected,
                                                                  vsplat_plan* out_plan);

#ifdef __cplusplus
}
#endif

#endif
