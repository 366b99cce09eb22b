/* A scene moved towards the user's own pictures by gradient descent, and judged on pictures that it was not moved
   towards. Part of vsplat.h, which includes it and whose conventions hold: handles, statuses, structs with their size.

   Pictures are held out as `holdout` says. The result is never worse than the start by the measure of those: where the
   start is best it is what comes out, and `returned` says so. With fewer than 12 views none can be spared: then each is
   left out in turn to find the number of steps (each of these rounds ends where its measure has fallen twice in a row,
   and only what all of them have measured counts), and all are fitted that often. The same device, input and options give
   the same bits (but for `seconds`, with which the number of steps depends on the clock). */
#ifndef VSPLAT_REFINE_H
#define VSPLAT_REFINE_H

#include <vsplat/device.h>
#include <vsplat/model.h>
#include <vsplat/reconstruct.h>
#include <vsplat/scene.h>
#include <vsplat/status.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What it begins with. */
typedef enum vsplat_refine_start {
  VSPLAT_REFINE_SCENE = 0,   /* `scene`. It may have seen every picture: no gain over it is claimed */
  VSPLAT_REFINE_NETWORK = 1, /* what `model` makes of `input`'s views; one that is held out is not given to it */
  VSPLAT_REFINE_POINTS = 2,  /* the points of the COLMAP model that the views are from, those in the object's cube */
  VSPLAT_REFINE_RANDOM = 3   /* points at random in the object's cube, by the seed */
} vsplat_refine_start;

typedef enum vsplat_holdout {
  VSPLAT_HOLDOUT_AUTO = 0,  /* with 12 views or more every eighth; with fewer each is left out in turn */
  VSPLAT_HOLDOUT_NONE = 1,  /* none: nothing is measured, and nothing guards against a result worse than the start */
  VSPLAT_HOLDOUT_COUNT = 2, /* `holdout_count` of them, evenly spread over the list */
  VSPLAT_HOLDOUT_NAMES = 3  /* those named in `holdout_names` */
} vsplat_holdout;

/* Which parameters stay as they are: bits of `freeze`. */
typedef enum vsplat_freeze {
  VSPLAT_FREEZE_MEANS = 1,
  VSPLAT_FREEZE_SCALES = 2,
  VSPLAT_FREEZE_ROTATIONS = 4,
  VSPLAT_FREEZE_OPACITIES = 8,
  VSPLAT_FREEZE_SH = 16
} vsplat_freeze;

/* What a refinement tells as it goes. */
typedef struct vsplat_refine_progress {
  size_t size;
  char phase[32];      /* "leaving out 2 of 4", "refining" */
  int64_t step, steps; /* of the phase */
  uint64_t gaussians;
  double loss;         /* of the last picture: mean absolute error, and SSIM's share; NaN before the first step */
  double psnr;         /* of the pictures held out, when they were last judged; NaN where never */
  double seconds_left; /* of all phases, by the steps of this run in which no kernel was compiled; 0: none yet */
} vsplat_refine_progress;
#define VSPLAT_REFINE_PROGRESS_INIT \
  { sizeof(vsplat_refine_progress), {0}, 0, 0, 0, 0.0, 0.0, 0.0 }

typedef struct vsplat_refine_options {
  size_t size;
  vsplat_refine_start start;
  vsplat_scene scene;                /* of VSPLAT_REFINE_SCENE */
  vsplat_model model;                /* of VSPLAT_REFINE_NETWORK */
  const vsplat_input_options* input; /* where the object is, and of VSPLAT_REFINE_NETWORK the views that the network
                                        gets, of those used: what is held out is never among them; NULL: defaults */
  const vsplat_reconstruct_options* reconstruct; /* of VSPLAT_REFINE_NETWORK; voxels, selection, dump and progress do
                                                    not apply; NULL: its defaults */
  const char* const* names; /* [num_names] the views that are used, as vsplat_input_options has them but in any number;
                               NULL: all that have a picture */
  size_t num_names;
  vsplat_holdout holdout;
  int32_t holdout_count;
  const char* const* holdout_names; /* [num_holdout_names] */
  size_t num_holdout_names;
  int64_t steps;  /* 0: by the number of views; with few, what is best for views left out */
  double seconds; /* no step begins that would end later than this, with the look at pictures that follows it and
                             that at the end; making the start and judging count. 0: no limit */
  uint64_t max_gaussians; /* it may grow up to; 0: by the pictures; with few views it does not grow. Of
                             VSPLAT_REFINE_POINTS and _RANDOM also the number that it begins with at the most */
  int32_t sh_degree;      /* 0 to 3; -1: the start's with few views, at least 2 with many */
  int32_t longest;        /* pixels of the pictures' longer side, scaled down by area; 0: as they are */
  uint32_t freeze;        /* of vsplat_freeze */
  uint64_t seed;
  int32_t poses;          /* 1: the cameras that are fitted to are corrected a little, too (_get_view, _save_cameras) */
  int32_t exposure;       /* 1: each picture fitted to has an affine map of colours, dropped at the end */
  const char* checkpoint; /* a folder into which the state is written now and then, and from which an interrupted
                             refinement is gone on with to the same bits; NULL: none */
  int32_t resume;         /* 1: go on from `checkpoint` where there is a state; it must be of the same request, and
                             of the same tuned parameters (vsplat_device_info.tuning) */
} vsplat_refine_options;
#define VSPLAT_REFINE_OPTIONS_INIT                                                                                     \
  {                                                                                                                    \
    sizeof(vsplat_refine_options), VSPLAT_REFINE_SCENE, NULL, NULL, NULL, NULL, NULL, 0, VSPLAT_HOLDOUT_AUTO, 0, NULL, \
        0, 0, 0.0, 0, -1, 512, 0, 0, 0, 0, NULL, 0                                                                     \
  }

/* A refinement under way. Belongs to its device. */
typedef struct vsplat_refinement_impl* vsplat_refinement;

/* Reads the pictures' sizes and makes the start, which `options` are needed to tell. Nothing of them need live on, but
   handles are kept alive. Errors: of `input`, as vsplat_input_prepare; VSPLAT_ERROR_USAGE where no view is left to fit
   to or a view is not there; VSPLAT_ERROR_INPUT where the start has no Gaussian; VSPLAT_ERROR_MEMORY with both
   figures. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_refinement_create(vsplat_device device, vsplat_views views,
                                                                   const vsplat_refine_options* options,
                                                                   vsplat_refinement* out_refinement);
VSPLAT_API void vsplat_refinement_retain(vsplat_refinement refinement);
VSPLAT_API void vsplat_refinement_release(vsplat_refinement refinement);

/* One step, of whatever phase comes next. *out_more is 0 once there is none left; `out_progress` may be NULL, which
   saves waiting for the loss. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_refinement_step(vsplat_refinement refinement,
                                                                 vsplat_refine_progress* out_progress,
                                                                 int32_t* out_more);

/* Ends it where it stands: no further step, and the result is the best so far. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_refinement_stop(vsplat_refinement refinement);

/* The best scene so far: after the last step the result. In the world of the views' cameras. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_refinement_get_scene(vsplat_refinement refinement,
                                                                      vsplat_scene* out_scene);
/* What it began with: of VSPLAT_REFINE_NETWORK what the network makes of the views that are not held out. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_refinement_get_start(vsplat_refinement refinement,
                                                                      vsplat_scene* out_scene);

typedef struct vsplat_refine_result {
  size_t size;
  int64_t steps;      /* that the result has seen */
  double seconds;     /* spent, from making the start on */
  int32_t returned;   /* 0: the refined scene, 1: the start, which was better on what was held out, or of which nothing
                          was known to be worse */
  int32_t claimed;    /* 1: `start` and `result` were judged on pictures that neither has seen */
  int32_t num_judged; /* pictures that it was judged on; with few views each by a scene made without it; 0: none */
  double start_psnr, start_ssim;   /* means over them, over white; NaN where there are none */
  double result_psnr, result_ssim; /* of what would have been returned without the start to fall back on */
  int32_t num_suspects;            /* pictures that the others disagree with */
} vsplat_refine_result;
#define VSPLAT_REFINE_RESULT_INIT \
  { sizeof(vsplat_refine_result), 0, 0.0, 0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0 }

VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_refinement_get_result(vsplat_refinement refinement,
                                                                       vsplat_refine_result* out_result);

typedef enum vsplat_refine_views {
  VSPLAT_REFINE_USED = 0,    /* all that it was given to use, in their order */
  VSPLAT_REFINE_JUDGED = 1,  /* those that it is judged on: with few views all of them */
  VSPLAT_REFINE_SUSPECTS = 2 /* those that the others disagree with, worst first; none before it has ended */
} vsplat_refine_views;

/* Places in the list of views. *out_count is how many there are; as many as fit `capacity` are written (out_views may
   be NULL with capacity 0). */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_refinement_get_views(vsplat_refinement refinement,
                                                                      vsplat_refine_views which, int32_t* out_views,
                                                                      size_t capacity, size_t* out_count);
/* View `index` of those listed, as it is fitted or judged: its camera (pinhole, scaled along, in the world, corrected
   where `poses` is 1), and its picture over white, float [height][width][3], into the caller's memory of `capacity`
   floats; either may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_refinement_get_view(vsplat_refinement refinement, size_t index,
                                                                     vsplat_camera* out_camera, float* out_pixels,
                                                                     size_t capacity);

/* Writes the cameras of all views that are used, as vsplat_refinement_get_view gives them, as cameras.json; an existing
   file is replaced. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_refinement_save_cameras(vsplat_refinement refinement,
                                                                         const char* path);

/* Device memory of a step and of judging: `gaussians` of `sh_degree` after all growth, pictures of width x height,
   each Gaussian taken to be seen and to touch eight tiles of 16 x 16 pixels. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_plan_refinement(vsplat_device device, uint64_t gaussians,
                                                                 int32_t sh_degree, int32_t width, int32_t height,
                                                                 vsplat_plan* out_plan);

#ifdef __cplusplus
}
#endif

#endif
