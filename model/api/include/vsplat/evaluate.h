/* How well a model reconstructs the objects of data sets. Part of vsplat.h, which includes it and whose conventions
   hold: handles, statuses, structs with their size. */
#ifndef VSPLAT_EVALUATE_H
#define VSPLAT_EVALUATE_H

#include <vsplat/dataset.h>
#include <vsplat/device.h>
#include <vsplat/model.h>
#include <vsplat/status.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Which views of an object are compared. Inputs are always the first views of k-means groups of the cameras' positions,
   as many as the model's configuration says, or as are asked for. */
typedef enum vsplat_protocol {
  VSPLAT_PROTOCOL_KMEANS = 0,  /* the last view of each of four k-means groups */
  VSPLAT_PROTOCOL_RANDOM10 = 1 /* ten views at random, by the seed and the object's name */
} vsplat_protocol;

/* Of all novel views of an object at the size that is compared, on white, laid side by side. PSNR in dB for a peak of
   1. Equal pictures have an infinite one. Where a photograph without mask or alpha ends inside its square, all is white
   and PSNR is over what it shows. */
typedef struct vsplat_scores {
  size_t size;
  double psnr;                  /* of the result, by the mean squared error of its views together */
  double psnr_coarse;           /* of the coarse level */
  double ssim;                  /* of the result: 11 x 11 Gaussian windows (sigma 1.5) */
  double psnr_white;            /* of white pictures */
  double psnr_nearest;          /* of the input view nearest to each novel one, by angle seen from the cube's centre */
  double selected;              /* voxels selected, a share of 0 to 1 */
  double lpips_alex, lpips_vgg; /* of the result; NaN where there were no weights for it */
  double pose_degrees;  /* between the inputs' rotations as told to the network and as listed; NaN without noise */
  double pose_distance; /* between their centres, in edges of the cube */
  double ray_degrees;   /* between predicted rays' directions and those of the listed poses; NaN where none are
                                   predicted */
  double ray_moment;    /* between their moments */
  double gaussians;     /* of the network's result */
  double seconds;       /* that the network took for it; of an evaluation's first object with what compiling took */
} vsplat_scores;
#define VSPLAT_SCORES_INIT \
  { sizeof(vsplat_scores), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0 }

typedef struct vsplat_evaluate_options {
  size_t size;
  vsplat_protocol protocol;
  uint64_t seed;      /* of RANDOM10, and of pose_noise */
  int32_t has_center; /* this and the next four as in vsplat_input_options; they hold for every object */
  double center[3];
  double scale;
  int32_t auto_frame;
  vsplat_fit fit;
  const char* lpips;                 /* folder with alex.safetensors, vgg.safetensors or both: torchvision's
                                        features.N.weight and .bias, and LPIPS' linK.model.1.weight; NULL: no LPIPS */
  int32_t skip_bad;                  /* 1: views and objects that cannot be read are told as warnings and passed over */
  int32_t sheet;                     /* 1: make one */
  vsplat_progress_function progress; /* may be NULL; the "stage" is the object's name */
  void* user;                        /* of both functions */
  int32_t picture_size; /* pictures are compared at N x N pixels: the truth resampled to it by area, the result drawn in
                           it; the inputs stay at the model's size. 0: at the model's size */
  /* May be NULL. Called after each object, so that what is done is kept where a later one is an error or `progress`
     cancels; both arguments are valid during the call. */
  void (*on_object)(void* user, const char* name, const vsplat_scores* scores);
  int32_t
      refine; /* 1: what is compared is the scene moved towards the inputs, and them alone, as vsplat/refine.h has it
                     by default; the coarse level stays the network's */
  /* Noise on the poses that the network is told of the inputs but the first: its deviation, in radians and edges of the
     cube, 0 to 1 (0: none), and how often it is drawn (0: once); an object's numbers are the means. By `seed` and the
     object's name, the same for every model. What is compared is drawn from the poses as listed. Not with `refine`. */
  double pose_noise;
  int32_t pose_draws;
  int32_t view_count; /* how many views go in; 0: as many as the model's configuration says */
  /* [num_more_devices] devices or streams that take objects beside the call's device, each the next when it is free;
     the call has them, too. Functions come one at a time then, on any of their threads; on_object in order. One that
     fails is told as a warning, and the others do its object. NULL: none */
  const vsplat_device* more_devices;
  size_t num_more_devices;
  int32_t ranks; /* not 0: the ranks of vsplat/ranks.h share the objects, each on its devices. Rank 0 has the whole, and
                    the errors; on_object comes there at the end. On the others the result is that of their own objects,
                    and VSPLAT_OK */
  uint64_t supersample; /* as in vsplat_render_options, 0: by how fine the inputs are at the model's size. Scenes of
                           `refine` have one sample where it is 0 */
} vsplat_evaluate_options;
#define VSPLAT_EVALUATE_OPTIONS_INIT                                                                               \
  {                                                                                                                \
    sizeof(vsplat_evaluate_options), VSPLAT_PROTOCOL_KMEANS, 0, 0, {0, 0, 0}, 0.0, 0, VSPLAT_FIT_AUTO, NULL, 0, 0, \
        NULL, NULL, 0, NULL, 0, 0.0, 0, 0, NULL, 0, 0, 0                                                           \
  }

/* The results of one run. Belongs to no device; may be read by several threads. */
typedef struct vsplat_evaluation_impl* vsplat_evaluation;

/* Reconstructs every object of the data set and compares pictures of it with those given, over novel views only. Bad
   views are VSPLAT_ERROR_FILE, _FORMAT or _INPUT naming object, view and what is wrong; with skip_bad only where
   nothing is left. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_evaluate(vsplat_device device, vsplat_model model,
                                                          vsplat_dataset dataset,
                                                          const vsplat_evaluate_options* options,
                                                          vsplat_evaluation* out_evaluation);
VSPLAT_API void vsplat_evaluation_retain(vsplat_evaluation evaluation);
VSPLAT_API void vsplat_evaluation_release(vsplat_evaluation evaluation);

/* How many objects were evaluated, and how many were passed over. Either out_ pointer may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_evaluation_count(vsplat_evaluation evaluation, size_t* out_objects,
                                                                  size_t* out_skipped);
/* Object `index` in the data set's order: its name, freed with vsplat_text_free, and its scores. Either out_ pointer
   may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_evaluation_get(vsplat_evaluation evaluation, size_t index,
                                                                char** out_name, vsplat_scores* out_scores);
/* The mean of every number over the objects. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_evaluation_get_mean(vsplat_evaluation evaluation,
                                                                     vsplat_scores* out_scores);
/* Writes the sheet as 8-bit PNG, whole or not at all; an existing file is replaced. The best, the median and the worst
   object by PSNR side by side, up to four views each; rows from above: inputs, truth, coarse level, result.
   VSPLAT_ERROR_USAGE where none was made. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_evaluation_save_sheet(vsplat_evaluation evaluation, const char* path);

/* ---------------------------------------------------------------------------- whether weights do what they should */

typedef struct vsplat_check_options {
  size_t size;
  vsplat_progress_function progress; /* may be NULL */
  void* user;
} vsplat_check_options;
#define VSPLAT_CHECK_OPTIONS_INIT \
  { sizeof(vsplat_check_options), NULL, NULL }

/* For weights of unknown worth, as of a checkpoint that was just imported: reconstructs an object that needs no file,
   the same for every model, and draws its input views again. `out_text` becomes a JSON object: "object" (its name),
   "image" (pixels along an edge), "views", a list of {"name", "psnr", "psnr_nearest"} in dB on white, "psnr" and
   "psnr_nearest", their means, "below_nearest" and "gaussians". psnr_nearest is what the other input nearest by angle
   reaches in the view's place: where below_nearest is true, the weights are untrained, damaged or read wrongly. Numbers
   that are not finite are null. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_check(vsplat_device device, vsplat_model model,
                                                             const vsplat_check_options* options, char** out_text);

#ifdef __cplusplus
}
#endif

#endif
