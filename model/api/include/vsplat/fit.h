/* Fits a scene to the user's own pictures by gradient descent, and measures it on held-out views. Part
   of vsplat.h, which includes this file and states the common conventions: handles, statuses, structs that begin with
   their size.

   `holdout` chooses the held-out views. By their measure the result is never worse than the start: if the start is
   best, it is the result, and `returned` says so. With fewer than 12 views none can be held out permanently. Then
   each view is left out in turn to find the number of steps, and finally all views are fitted for that many steps.
   Each of these rounds ends when its measure has fallen twice in a row, and only steps that all rounds have measured
   count. With `seconds`, rounds end early or are not begun, so that time is left to fit all views; only the views left
   out until then are measured. Equal device, input and options give equal bits (except with `seconds`, which makes the
   number of steps depend on the clock).

   A whole scene is different: with five views or more, every eighth is held out, with fewer none, and the result is what
   the last step made. */
#ifndef VSPLAT_FIT_H
#define VSPLAT_FIT_H

#include <vsplat/device.h>
#include <vsplat/model.h>
#include <vsplat/reconstruct.h>
#include <vsplat/scene.h>
#include <vsplat/status.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What the fit starts from. */
typedef enum vsplat_fit_start {
  VSPLAT_FIT_SCENE = 0,   /* `scene`. It may have seen every picture, so no gain over it is claimed */
  VSPLAT_FIT_NETWORK = 1, /* what `model` makes of `input`'s views, without those held out; of a whole scene that is an
                             object, and its points, or random ones, are around the object's cube */
  VSPLAT_FIT_POINTS = 2,  /* the sparse points of the views: those in the object's cube, or for a whole scene all that
                             are reliable, and some Gaussians far away where pictures show no points */
  VSPLAT_FIT_RANDOM = 3,  /* random points in the object's cube, or where the pictures look, by the seed */
  VSPLAT_FIT_AUTO = 4     /* for a whole scene its points, or random ones if it has none. For an object the network if
                             `model` is given and fewer than 12 views are used, else its points, else random ones */
} vsplat_fit_start;

/* Presets: the number of steps of a whole scene, and the pictures' size. An object with 12 views or more has a quarter
   more steps. */
typedef enum vsplat_fit_quality {
  VSPLAT_QUALITY_DRAFT = 0,  /* 2,000 steps, longer side of 512 pixels */
  VSPLAT_QUALITY_NORMAL = 1, /* 7,000 steps, 1,024 pixels */
  VSPLAT_QUALITY_HIGH = 2    /* 30,000 steps, 1,600 pixels */
} vsplat_fit_quality;

/* What is fitted. */
typedef enum vsplat_fit_extent {
  VSPLAT_EXTENT_OBJECT = 0, /* an object: Gaussians begin in its cube, and what pictures show outside is white */
  VSPLAT_EXTENT_SCENE = 1,  /* all that the pictures show. The frame follows from the cameras */
  VSPLAT_EXTENT_AUTO = 2    /* the whole scene, unless the start is the network, a cube is given or listed, or pictures
                               have masks or alpha */
} vsplat_fit_extent;

typedef enum vsplat_holdout {
  VSPLAT_HOLDOUT_AUTO = 0,  /* with 12 views or more, every eighth; with fewer, each is left out in turn. Of a whole
                               scene every eighth of five views or more */
  VSPLAT_HOLDOUT_NONE = 1,  /* none: nothing is measured, and the result may be worse than the start */
  VSPLAT_HOLDOUT_COUNT = 2, /* `holdout_count` views, evenly spread over the list */
  VSPLAT_HOLDOUT_NAMES = 3  /* the views named in `holdout_names` */
} vsplat_holdout;

/* Frozen parameters: bits of `freeze`. */
typedef enum vsplat_freeze {
  VSPLAT_FREEZE_MEANS = 1,
  VSPLAT_FREEZE_SCALES = 2,
  VSPLAT_FREEZE_ROTATIONS = 4,
  VSPLAT_FREEZE_OPACITIES = 8,
  VSPLAT_FREEZE_SH = 16
} vsplat_freeze;

/* Where a fit with many views takes Gaussians away and adds others; what is nearly transparent is always replaced. */
typedef enum vsplat_density {
  VSPLAT_DENSITY_MCMC = 0, /* others are added where opaque ones are, which share their opacity (3DGS-MCMC) */
  VSPLAT_DENSITY_ERROR = 1 /* those that cover the pictures' errors are split along their longest axis */
} vsplat_density;

/* What is behind the Gaussians where transmittance is left, while fitting and where pictures are measured. */
typedef enum vsplat_background {
  VSPLAT_BACKGROUND_AUTO = 0, /* of a whole scene VSPLAT_BACKGROUND_SKY, or _RANDOM if pictures have masks or alpha; of
                                 an object white, and pictures whose mask or alpha marks it are fitted over a random
                                 colour in every other step */
  VSPLAT_BACKGROUND_COLOUR = 1, /* `background_colour` */
  VSPLAT_BACKGROUND_RANDOM = 2, /* a random colour in every step, which leaves no holes; measured over black */
  VSPLAT_BACKGROUND_SKY = 3     /* a sky that is fitted, too: spherical harmonics of degree 4 over directions. In the
                                   scene it is a sphere of 10,000 Gaussians about the cameras' mean, with a radius of
                                   100 edges of the cube, or units of a whole scene, and the result is measured with those over black. The start
                                   is measured before mid grey. Not for pictures whose mask or alpha marks an object */
} vsplat_background;

/* What is outside a mask. Alpha in a picture always marks the object. */
typedef enum vsplat_masks {
  VSPLAT_MASKS_OBJECT = 0, /* nothing: the mask shows the object, and the scene is empty around it */
  VSPLAT_MASKS_IGNORE = 1  /* something unknown, such as people who walk past: pixels that lie inside the mask by less
                              than nine tenths take no part in the fit, nor in what is measured */
} vsplat_masks;

/* Progress of a fit. */
typedef struct vsplat_fit_progress {
  size_t size;
  char phase[32];      /* "leaving out 2 of 4", "fitting", "consolidating" */
  int64_t step, steps; /* of the phase */
  uint64_t gaussians;
  double loss;         /* of the last picture: mean absolute error plus the SSIM term; NaN before the first step */
  double psnr;         /* of the held-out views, when last measured; NaN before that */
  double seconds_left; /* for all phases as the scene grows, with what is measured, estimated from this run's steps in
                          which no kernel was compiled; 0: none yet */
} vsplat_fit_progress;
#define VSPLAT_FIT_PROGRESS_INIT \
  { sizeof(vsplat_fit_progress), {0}, 0, 0, 0, 0.0, 0.0, 0.0 }

/* Depths that drawings are compared with, beside the pictures' colours. */
typedef enum vsplat_fit_depth {
  VSPLAT_FIT_DEPTH_NONE = 0,
  VSPLAT_FIT_DEPTH_METRIC = 1,   /* the depth pictures that a transforms.json names (depth_file_path: grey PNG of whole
                                    numbers in units of depth_unit_scale_factor, a thousandth if that is not there, or
                                    the channel Z of an EXR): distances along the camera's axis, 0 where unknown */
  VSPLAT_FIT_DEPTH_RELATIVE = 2, /* the same, but for a scale and a shift of each picture, which are found out */
  VSPLAT_FIT_DEPTH_INVERSE = 3,  /* the same of 1 / distance, as networks for single pictures make them */
  VSPLAT_FIT_DEPTH_POINTS = 4    /* of the points of a COLMAP model, in the pictures that see them */
} vsplat_fit_depth;

typedef struct vsplat_fit_options {
  size_t size;
  vsplat_fit_start start;
  vsplat_scene scene;                /* for VSPLAT_FIT_SCENE */
  vsplat_model model;                /* for VSPLAT_FIT_NETWORK */
  const vsplat_input_options* input; /* where the object is, of a whole scene only for VSPLAT_FIT_NETWORK; for that
                                        also which of the used views the network gets, never a held-out one; NULL:
                                        defaults */
  const vsplat_reconstruct_options* reconstruct; /* for VSPLAT_FIT_NETWORK; voxels, selection, dump and progress are
                                                    ignored; NULL: defaults */
  const char* const* names; /* [num_names] the views to use, named as in vsplat_input_options, in any number; NULL: all
                               that have a picture */
  size_t num_names;
  vsplat_holdout holdout;
  int32_t holdout_count;
  const char* const* holdout_names; /* [num_holdout_names] */
  size_t num_holdout_names;
  int64_t steps;  /* 0: by `quality`; for an object with few views, the number that is best for views left out */
  double seconds; /* time limit, 0: none. No step begins that would end later, counting the measurement that follows it
                     and the one at the end; making the start and measuring count too */
  uint64_t max_gaussians; /* limit of growth; 0: chosen from the pictures; with few views the scene does not grow. For
                             VSPLAT_FIT_POINTS and _RANDOM it also limits the number at the start */
  int32_t sh_degree;      /* 0 to 3; -1: the start's with few views, 3 with many */
  int32_t longest; /* longer side of the pictures in pixels, scaled down by area; 0: unscaled; -1: by `quality` */
  uint32_t freeze; /* bits of vsplat_freeze */
  uint64_t seed;
  int32_t poses;          /* 1: also corrects the cameras of fitted views slightly (_get_view, _save_cameras) */
  int32_t exposure;       /* 1: fits an affine colour map for each fitted picture, dropped at the end */
  const char* checkpoint; /* a folder for the state, written from time to time; an interrupted fit resumes from it with
                             equal bits; NULL: none */
  int32_t resume;         /* 1: resume from `checkpoint` if it holds a state; that must be of the same request and the
                             same tuned parameters (vsplat_device_info.tuning) */
  double near_plane;      /* of the fit and of the scene that it makes, in world units; 0: the start's, or for a whole
                             scene a hundredth of the distance to the nearest points that the pictures show */
  vsplat_fit_extent extent;
  vsplat_fit_quality quality;
  int32_t antialias; /* 1: draws with anti-aliasing (vsplat_render_options), and the result has
                        vsplat_scene_info.antialias; a start that has it is always fitted so */
  vsplat_density density;
  /* The share of the Gaussians that stays for the last quarter of the steps, those with the most visible pixels in the
     fitted pictures, in (0,1]; below 1 only for 12 views or more, or a whole scene. 0: 0.5 for an object that grows
     while max_gaussians is 0, and 1 otherwise. If the fit is stopped before, every Gaussian stays. */
  double consolidate;
  vsplat_background background;
  float background_colour[3]; /* red, green, blue in [0,1]; for VSPLAT_BACKGROUND_COLOUR */
  vsplat_masks masks;
  int32_t invert_masks;   /* 1: masks are black inside, not white */
  vsplat_fit_depth depth; /* not with VSPLAT_DENSITY_ERROR */
  /* Weight of the depth's loss, the mean over pixels with a known depth of
     alpha |log(drawn depth) - log(depth)| + 1 - alpha, added to the mean absolute error of colours. Above 0 with
     `depth`. */
  float depth_weight;
} vsplat_fit_options;
#define VSPLAT_FIT_OPTIONS_INIT                                                                                        \
  {                                                                                                                    \
    sizeof(vsplat_fit_options), VSPLAT_FIT_SCENE, NULL, NULL, NULL, NULL, NULL, 0, VSPLAT_HOLDOUT_AUTO, 0, NULL, 0, 0, \
        0.0, 0, -1, -1, 0, 0, 0, 0, NULL, 0, 0.0, VSPLAT_EXTENT_OBJECT, VSPLAT_QUALITY_DRAFT, 0, VSPLAT_DENSITY_MCMC,  \
        0.0, VSPLAT_BACKGROUND_AUTO, {1.0, 1.0, 1.0}, VSPLAT_MASKS_OBJECT, 0, VSPLAT_FIT_DEPTH_NONE, 0.1               \
  }

/* A fit in progress. Belongs to its device. */
typedef struct vsplat_fit_impl* vsplat_fit;

/* Reads the pictures' sizes and makes the start, for which `options` are needed. The options need not outlive the call;
   their handles are kept alive. Errors: those of vsplat_input_prepare for `input`; VSPLAT_ERROR_USAGE: a view does not
   exist, or none is left to fit; VSPLAT_ERROR_INPUT: the start has no Gaussian; VSPLAT_ERROR_MEMORY with both
   figures. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_fit_create(vsplat_device device, vsplat_views views,
                                                            const vsplat_fit_options* options, vsplat_fit* out_fit);
VSPLAT_API void vsplat_fit_retain(vsplat_fit fit);
VSPLAT_API void vsplat_fit_release(vsplat_fit fit);

/* Runs one step of the current phase. *out_more becomes 0 after the last step; `out_progress` may be NULL, which avoids
   waiting for the loss. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_fit_step(vsplat_fit fit, vsplat_fit_progress* out_progress,
                                                          int32_t* out_more);

/* Ends the fit: no further step is run, and the result is the best scene so far. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_fit_stop(vsplat_fit fit);

/* The best scene so far, after the last step the result. In the world of the views' cameras. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_fit_get_scene(vsplat_fit fit, vsplat_scene* out_scene);
/* The scene it started from; for VSPLAT_FIT_NETWORK the network's scene from the views that are not held out. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_fit_get_start(vsplat_fit fit, vsplat_scene* out_scene);

typedef struct vsplat_fit_result {
  size_t size;
  int64_t steps;    /* steps that the result has run */
  double seconds;   /* time spent, including making the start */
  int32_t returned; /* 0: the fitted scene; 1: the start, which was better on the held-out views, or which nothing
                         showed to be worse */
  int32_t claimed;  /* 1: `start` and `result` were measured on pictures that neither has seen */
  int32_t
      num_held_out; /* number of held-out pictures; with few views, each was measured with a scene fitted without it;
                         0: none */
  double start_psnr, start_ssim;   /* means over those, over the background; NaN if there are none */
  double result_psnr, result_ssim; /* of the scene that would be returned if the start could not be */
  int32_t num_outliers;            /* number of outliers: pictures that disagree with the others */
  double sky_psnr, sky_ssim; /* with VSPLAT_BACKGROUND_SKY and views held out for the whole fit: those of the result
                                before its sky became Gaussians; else NaN */
  float background[3];       /* that pictures are measured over */
  int32_t in_turn;           /* 1: with few views, each of the held-out views was left out in turn */
  uint64_t peak;             /* the most device memory held since the fit began, in bytes */
} vsplat_fit_result;
#define VSPLAT_FIT_RESULT_INIT \
  { sizeof(vsplat_fit_result), 0, 0.0, 0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0, 0.0, 0.0, {0, 0, 0}, 0, 0 }

VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_fit_get_result(vsplat_fit fit, vsplat_fit_result* out_result);

/* The settings in effect, after defaults and what depends on the views and the start, as a JSON object by the names of
   `vsplat fit`'s options: {"steps": 2000, "size": 512, "sh": 2, "max-gaussians": null, ...}; null: not limited, or
   found out by the fit. The field "derived" holds what is no option, or must not be given back as one:
   {"extent", "max_gaussians", "consolidate", "picture", "center", "scale"}; "picture" is the largest one's [width,
   height] in pixels, and a whole scene's "scale" its unit of length. Free the text with vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_fit_get_settings(vsplat_fit fit, char** out_text);

/* The memory that the fit takes at its largest, as it was planned: with as many Gaussians as it grows to, and its
   largest picture. `peak` includes what the device held before. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_fit_get_plan(vsplat_fit fit, vsplat_plan* out_plan);

typedef enum vsplat_fit_views {
  VSPLAT_FIT_USED = 0,     /* all views used for fitting, in their order */
  VSPLAT_FIT_HELD_OUT = 1, /* the held-out views; with few views, those left out in turn */
  VSPLAT_FIT_OUTLIERS = 2  /* the outliers, pictures that disagree with the others, worst first; empty until the fit
                                has ended */
} vsplat_fit_views;

/* Indices into the list of views. *out_count is how many there are; as many as fit `capacity` are written (out_views
   may be NULL with `capacity` 0). */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_fit_get_views(vsplat_fit fit, vsplat_fit_views which,
                                                               int32_t* out_views, size_t capacity, size_t* out_count);
/* View `index` of the list as it is fitted or measured: its camera (a pinhole, scaled with the picture, in the world,
   corrected if `poses` is 1), and its picture over the background, float [height][width][3], into the caller's memory
   of `capacity` floats. `out_camera` and `out_pixels` may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_fit_get_view(vsplat_fit fit, size_t index, vsplat_camera* out_camera,
                                                              float* out_pixels, size_t capacity);

/* Writes the cameras of all used views, as vsplat_fit_get_view returns them, as cameras.json; replaces an
   existing file. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_fit_save_cameras(vsplat_fit fit, const char* path);

/* Plans the device memory of a step and of measuring, beside what the device holds already: `gaussians` of `sh_degree`
   after all growth, pictures of width x height. Assumes that each Gaussian is visible and touches eight tiles of
   16 x 16 pixels. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_plan_fit(vsplat_device device, uint64_t gaussians, int32_t sh_degree,
                                                          int32_t width, int32_t height, vsplat_plan* out_plan);

/* Earlier names of the same, for programs written with them. */
#define vsplat_refinement vsplat_fit
#define vsplat_refinement_create vsplat_fit_create
#define vsplat_refinement_retain vsplat_fit_retain
#define vsplat_refinement_release vsplat_fit_release
#define vsplat_refinement_step vsplat_fit_step
#define vsplat_refinement_stop vsplat_fit_stop
#define vsplat_refinement_get_scene vsplat_fit_get_scene
#define vsplat_refinement_get_start vsplat_fit_get_start
#define vsplat_refinement_get_result vsplat_fit_get_result
#define vsplat_refinement_get_views vsplat_fit_get_views
#define vsplat_refinement_get_view vsplat_fit_get_view
#define vsplat_refinement_save_cameras vsplat_fit_save_cameras
#define vsplat_plan_refinement vsplat_plan_fit
#define vsplat_refine_start vsplat_fit_start
#define vsplat_refine_options vsplat_fit_options
#define vsplat_refine_progress vsplat_fit_progress
#define vsplat_refine_result vsplat_fit_result
#define vsplat_refine_views vsplat_fit_views
#define VSPLAT_REFINE_OPTIONS_INIT VSPLAT_FIT_OPTIONS_INIT
#define VSPLAT_REFINE_PROGRESS_INIT VSPLAT_FIT_PROGRESS_INIT
#define VSPLAT_REFINE_RESULT_INIT VSPLAT_FIT_RESULT_INIT
#define VSPLAT_REFINE_SCENE VSPLAT_FIT_SCENE
#define VSPLAT_REFINE_NETWORK VSPLAT_FIT_NETWORK
#define VSPLAT_REFINE_POINTS VSPLAT_FIT_POINTS
#define VSPLAT_REFINE_RANDOM VSPLAT_FIT_RANDOM
#define VSPLAT_PROGRAMS_OF_REFINE VSPLAT_PROGRAMS_OF_FIT
#define VSPLAT_REFINE_USED VSPLAT_FIT_USED
#define VSPLAT_REFINE_JUDGED VSPLAT_FIT_HELD_OUT
#define VSPLAT_REFINE_SUSPECTS VSPLAT_FIT_OUTLIERS

#ifdef __cplusplus
}
#endif

#endif
