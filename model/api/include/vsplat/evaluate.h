/* Measures how well a model reconstructs the objects of data sets, and scenes on photographs. Part of vsplat.h, which
   includes this file and states the common conventions: handles, statuses, structs that begin with their size. */
#ifndef VSPLAT_EVALUATE_H
#define VSPLAT_EVALUATE_H

#include <vsplat/dataset.h>
#include <vsplat/device.h>
#include <vsplat/fit.h>
#include <vsplat/model.h>
#include <vsplat/scene.h>
#include <vsplat/status.h>
#include <vsplat/views.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Which views of an object are compared. Inputs are always the first views of k-means groups of the camera positions;
   their number is view_count, or the model configuration's. */
typedef enum vsplat_protocol {
  VSPLAT_PROTOCOL_KMEANS = 0,  /* the last view of each of four k-means groups */
  VSPLAT_PROTOCOL_RANDOM10 = 1 /* ten random views, chosen by the seed and the object's name */
} vsplat_protocol;

/* Scores over all novel views of an object, at the compared size, on white, laid side by side. PSNR is in dB for a peak
   of 1, and infinite for equal pictures. Where a photograph without mask or alpha ends inside its square, the rest of
   the square is white, and PSNR covers only the photograph's pixels. */
typedef struct vsplat_scores {
  size_t size;
  double psnr;                  /* of the result, from the mean squared error over all its views */
  double psnr_coarse;           /* of the coarse level */
  double ssim;                  /* of the result: 11 x 11 Gaussian windows (sigma 1.5) */
  double psnr_white;            /* of white pictures */
  double psnr_nearest;          /* of the input view nearest to each novel one, by the angle at the cube's centre */
  double selected;              /* share of voxels selected, 0 to 1 */
  double lpips_alex, lpips_vgg; /* of the result; NaN without LPIPS weights */
  double pose_degrees;  /* between the inputs' rotations as given to the network and as listed; NaN without noise */
  double pose_distance; /* between their centres, in edges of the cube */
  double ray_degrees;   /* between the directions of predicted rays and of those from the listed poses; NaN if none are
                           predicted */
  double ray_moment;    /* between their moments */
  double gaussians;     /* number in the network's result */
  double seconds;       /* time of the network; for the first object, compiling is included */
} vsplat_scores;
#define VSPLAT_SCORES_INIT \
  { sizeof(vsplat_scores), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0 }

typedef struct vsplat_evaluate_options {
  size_t size;
  vsplat_protocol protocol;
  uint64_t seed;      /* of RANDOM10 and of pose_noise */
  int32_t has_center; /* this and the next four fields are as in vsplat_input_options, and apply to every object */
  double center[3];
  double scale;
  int32_t auto_frame;
  vsplat_crop crop;
  const char* lpips;                 /* folder with alex.safetensors, vgg.safetensors or both: torchvision's
                                        features.N.weight and .bias, and LPIPS' linK.model.1.weight; NULL: no LPIPS */
  int32_t skip_bad;                  /* 1: views and objects that cannot be read are skipped with a warning */
  int32_t sheet;                     /* 1: make a contact sheet */
  vsplat_progress_function progress; /* may be NULL; the "stage" is the object's name */
  void* user;                        /* argument of both functions */
  int32_t picture_size; /* pictures are compared at N x N pixels: the truth is resampled to that size by area, the
                           result is drawn in it; the inputs keep the model's size. 0: the model's size */
  /* May be NULL. Called after each object, so that the caller has the finished results even if a later object fails or
     `progress` cancels. Both arguments are valid during the call. */
  void (*on_object)(void* user, const char* name, const vsplat_scores* scores);
  int32_t refine; /* 1: fits the scene to the inputs, and to them alone, with the defaults of vsplat/fit.h, and compares
                 the fitted scene; the coarse level stays the network's */
  /* Standard deviation of noise on the input poses given to the network, except the first: in radians and in edges of
     the cube, 0 to 1 (0: none). pose_draws is how often it is drawn (0: once); an object's scores are the means. The
     noise depends on `seed` and the object's name, so it is equal for every model. Compared pictures are drawn from the
     poses as listed. Cannot be combined with `refine`. */
  double pose_noise;
  int32_t pose_draws;
  int32_t view_count; /* number of input views; 0: the model configuration's */
  /* [num_more_devices] devices or streams that evaluate objects beside the call's device, which takes part too. Each
     takes the next object when it is free. Functions are then called one at a time, on any of their threads; on_object
     keeps the order. A device that fails gives a warning, and the others take its object. NULL: none */
  const vsplat_device* more_devices;
  size_t num_more_devices;
  int32_t ranks; /* not 0: the ranks of vsplat/ranks.h share the objects, each on its devices. Rank 0 gets all results
                    and errors, and calls on_object at the end. The other ranks get the results of their own objects and
                    VSPLAT_OK */
  uint64_t supersample; /* as in vsplat_render_options; 0: chosen from the inputs' resolution at the model's size.
                           Scenes of `refine` have one sample if it is 0 */
} vsplat_evaluate_options;
#define VSPLAT_EVALUATE_OPTIONS_INIT                                                                                \
  {                                                                                                                 \
    sizeof(vsplat_evaluate_options), VSPLAT_PROTOCOL_KMEANS, 0, 0, {0, 0, 0}, 0.0, 0, VSPLAT_CROP_AUTO, NULL, 0, 0, \
        NULL, NULL, 0, NULL, 0, 0.0, 0, 0, NULL, 0, 0, 0                                                            \
  }

/* The results of one run. Belongs to no device; several threads may read it. */
typedef struct vsplat_evaluation_impl* vsplat_evaluation;

/* Reconstructs every object of the data set and compares its pictures with the given ones, over novel views only. Bad
   views are VSPLAT_ERROR_FILE, _FORMAT or _INPUT naming object, view and what is wrong; with skip_bad this is an error
   only if nothing is left. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_evaluate(vsplat_device device, vsplat_model model,
                                                          vsplat_dataset dataset,
                                                          const vsplat_evaluate_options* options,
                                                          vsplat_evaluation* out_evaluation);
VSPLAT_API void vsplat_evaluation_retain(vsplat_evaluation evaluation);
VSPLAT_API void vsplat_evaluation_release(vsplat_evaluation evaluation);

/* Number of objects evaluated, and number skipped. Either out_ pointer may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_evaluation_count(vsplat_evaluation evaluation, size_t* out_objects,
                                                                  size_t* out_skipped);
/* Object `index` in the data set's order: its name (free it with vsplat_text_free) and its scores. Either out_ pointer
   may be NULL. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_evaluation_get(vsplat_evaluation evaluation, size_t index,
                                                                char** out_name, vsplat_scores* out_scores);
/* The mean of every score over the objects. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_evaluation_get_mean(vsplat_evaluation evaluation,
                                                                     vsplat_scores* out_scores);
/* Writes the contact sheet as 8-bit PNG, whole or not at all; replaces an existing file. It shows the best, the median
   and the worst object by PSNR side by side, up to four views each; rows from the top: inputs, truth, coarse level,
   result. VSPLAT_ERROR_USAGE: the run made no sheet. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_evaluation_save_sheet(vsplat_evaluation evaluation, const char* path);

/* ------------------------------------------------------------------------------ scenes compared with photographs */

/* A drawing of a scene compared with the photograph of the same view, or the means over several. Values of the drawing
   are clamped to [0,1]; pixels that the photograph's lens or mask leaves unknown take no part. */
typedef struct vsplat_measured {
  size_t size;
  int32_t view;          /* index in the list of views; -1 in a mean */
  int32_t width, height; /* pixels; 0 in a mean */
  double psnr;           /* dB for a peak of 1, over all known pixels and channels; infinite for equal pictures; NaN
                                   if no pixel is known */
  double psnr_cc;        /* the same after colour correction, as in vsplat_comparison */
  double ssim;           /* 11 x 11 Gaussian windows (sigma 1.5) that hold a known pixel; NaN if there is none, or if a
                                   side is under 11 pixels */
  double lpips_alex, lpips_vgg; /* NaN without LPIPS weights */
  const float* drawn;           /* [height][width][3], valid during the call of on_picture; NULL in a mean */
  const float* given;           /* the photograph, likewise */
} vsplat_measured;
#define VSPLAT_MEASURED_INIT \
  { sizeof(vsplat_measured), 0, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0, NULL, NULL }

typedef struct vsplat_measure_options {
  size_t size;
  const int32_t* views; /* [num_views] which views are compared, by index; NULL: all that have a picture */
  size_t num_views;
  const vsplat_camera* cameras; /* [num_views] where they are drawn from, of the pictures' sizes, in place of the listed
                                   cameras; NULL: those, without their lenses' distortion */
  int32_t longest;              /* longer side of the compared pictures in pixels: photographs are scaled down by area,
                                   and drawings have that size; 0: the photographs' own size */
  float background[3];          /* behind the scene, and behind alpha and masks of photographs */
  const char* lpips;            /* as in vsplat_evaluate_options */
  /* May be NULL. Called after each picture; returns 0 to stop: the call ends with VSPLAT_ERROR_CANCELLED. */
  int32_t (*on_picture)(void* user, const vsplat_measured* picture);
  void* user;
  vsplat_masks masks;   /* as in vsplat_fit_options */
  int32_t invert_masks; /* as in vsplat_fit_options */
} vsplat_measure_options;
#define VSPLAT_MEASURE_OPTIONS_INIT \
  { sizeof(vsplat_measure_options), NULL, 0, NULL, 512, {1, 1, 1}, NULL, NULL, NULL, VSPLAT_MASKS_OBJECT, 0 }

/* Draws the scene from the views' cameras, as vsplat_render does, and compares each drawing with its photograph.
   *out_mean receives the means over those with a known pixel; a warning names the others. VSPLAT_ERROR_USAGE: a view
   does not exist, or none has a picture. VSPLAT_ERROR_INPUT: no picture has a known pixel. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_scene_measure(vsplat_device device, vsplat_scene scene,
                                                               vsplat_views views,
                                                               const vsplat_measure_options* options,
                                                               vsplat_measured* out_mean);

/* --------------------------------------------------------------------------------------------- checks of weights */

typedef struct vsplat_check_options {
  size_t size;
  vsplat_progress_function progress; /* may be NULL */
  void* user;
} vsplat_check_options;
#define VSPLAT_CHECK_OPTIONS_INIT \
  { sizeof(vsplat_check_options), NULL, NULL }

/* Checks weights of unknown quality, such as those of a checkpoint just imported: reconstructs a built-in object, the
   same for every model, and draws its input views again. `out_text` becomes a JSON object: "object" (its name), "image"
   (pixels along an edge), "views", a list of {"name", "psnr", "psnr_nearest"} in dB on white, "psnr" and
   "psnr_nearest", their means, "below_nearest" and "gaussians". psnr_nearest is the PSNR of the other input nearest by
   angle, taken in place of the view. If below_nearest is true, the weights are untrained, damaged or read wrongly.
   Numbers that are not finite are null. `options` NULL: defaults. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_model_check(vsplat_device device, vsplat_model model,
                                                             const vsplat_check_options* options, char** out_text);

#ifdef __cplusplus
}
#endif

#endif
