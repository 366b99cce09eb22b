/* Training from posed pictures. Part of vsplat.h, which includes this file and states the common conventions: handles,
   statuses, structs that begin with their size. */
#ifndef VSPLAT_TRAIN_H
#define VSPLAT_TRAIN_H

#include <vsplat/device.h>
#include <vsplat/reconstruct.h>
#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Means over the steps since the last report; the two counts are maxima. */
typedef struct vsplat_train_progress {
  size_t size;
  int64_t step, steps;         /* steps done, and steps of the whole training */
  double learning_rate;        /* of the last step, like the temperature */
  double temperature;          /* of the Gumbel-Sigmoid */
  double loss;                 /* sum of both levels */
  double psnr, psnr_coarse;    /* dB, novel views; of the fine (or only) level, and of the coarse level */
  double selected;             /* share of the voxels, or primitives */
  double gradient_norm;        /* before clipping */
  uint64_t most_selected;      /* the most voxels of an object */
  uint64_t most_intersections; /* the most intersections of Gaussians with a picture's tiles */
  double seconds;              /* of this run so far */
  double objects_per_second;
  double seconds_left; /* estimated from this run's steps in which no kernel was compiled; 0: none yet */
} vsplat_train_progress;

/* Default of assume_selected: the share of the voxels (LaRa and GenDen: of the primitives) that a training is assumed
   to select. */
#define VSPLAT_TRAIN_ASSUME_SELECTED 0.25

typedef struct vsplat_train_options {
  size_t size;
  const char* const* data; /* data sets: folders of objects as vsplat_dataset_open reads them; not needed if all objects
                              are procedural */
  size_t num_data;
  const char* output; /* the run's folder, created if missing */
  int32_t resume;     /* not 0: resume from its newest good checkpoint */
  int32_t skip_bad;   /* not 0: skip and count data that cannot be read */
  void (*on_progress)(void* user, const vsplat_train_progress* progress); /* may be NULL, as may those below */
  void (*on_message)(void* user, const char* text);                       /* a file was written, or a note */
  int32_t (*go_on)(void* user); /* called after every step; 0: writes a checkpoint and ends the training */
  void* user;
  const char* selection;  /* NULL, or a file of voxels in the format of vsplat_scene_save_selection: every step refines
                             these, whatever the network would select */
  double assume_selected; /* share of the voxels that memory is allocated for at first; 0:
                             VSPLAT_TRAIN_ASSUME_SELECTED */
  uint64_t assume_intersections; /* in a picture, for the memory check before the start; 0: eight tiles for each
                                    Gaussian */
  const char* init;              /* NULL, or a model file with initial weights; its model must match the configuration.
                                    Not read when resuming. */
  const int64_t* extend; /* with `resume`: step counts of extensions after the configuration's steps; each extension has
                            its own warm-up and cosine schedule of the learning rate, and the temperature stays at its
                            final value. Giving the same counts again resumes the same extensions, or finds them done;
                            to extend further, append one count. NULL: as stored in the checkpoint */
  size_t num_extend;
  const char* textures; /* NULL, or a folder of pictures; half of the parts of procedural objects and of the walls of
                           interiors are textured with one of them */
  /* [num_more_devices] devices or streams that compute shards of each step beside the call's device, which takes part
     too, if the configuration's `parts` is more than 1. With devices of one kind, the bits equal those of a single one.
     A device that fails gives a warning, and the others continue. NULL: none */
  const vsplat_device* more_devices;
  size_t num_more_devices;
  int32_t ranks; /* not 0: the ranks of vsplat/ranks.h compute shards of each step, each on its devices; at least as
                    many shards as ranks are needed. Only rank 0 writes, calls functions and reports errors; on the
                    others the call ends at the same time, with VSPLAT_OK */
} vsplat_train_options;
#define VSPLAT_TRAIN_OPTIONS_INIT                                                                                 \
  {                                                                                                               \
    sizeof(vsplat_train_options), NULL, 0, NULL, 0, 0, NULL, NULL, NULL, NULL, NULL, 0.0, 0, NULL, NULL, 0, NULL, \
        NULL, 0, 0                                                                                                \
  }

typedef struct vsplat_train_result {
  size_t size;
  int64_t step;    /* steps done */
  int32_t stopped; /* not 0: go_on ended it */
  uint64_t bad;    /* views and objects skipped; with several ranks, by this one */
  uint64_t peak;   /* the most device memory held, in bytes */
} vsplat_train_result;
#define VSPLAT_TRAIN_RESULT_INIT \
  { sizeof(vsplat_train_result), 0, 0, 0, 0 }

/* Trains, from the beginning or from a checkpoint; several trainings one after another if the configuration has
   `stages` (see TRAINING.md of the documents). Writes to `output`: config.json, log.csv, sheets/, and the newest
   checkpoints, each whole or not at all, together with model.safetensors, which vsplat_model_load reads. During the run
   and at its end it also writes report.html, the run page of vsplat_train_report, and record.json, which that page is
   made from; if these two cannot be written, the training continues with a warning. `config`: a JSON object, see
   vsplat_train_config. `options` are needed, for `output`; `out_result` may be NULL. Equal configuration, data and
   device give equal bits, however often the training was interrupted. Callbacks are called on this thread and may not
   use the device.

   VSPLAT_ERROR_USAGE: the folder holds checkpoints and `resume` is 0, or checkpoints of another configuration, or of a
   device that ran with another table of tuned parameters (vsplat_device_info.tuning). VSPLAT_ERROR_FORMAT: a field of
   the configuration is wrong, or `init` is of another model. VSPLAT_ERROR_INPUT: bad data, naming object, view and
   field. VSPLAT_ERROR_MEMORY, before the start and with both figures: vsplat_train_plan says that it does not fit.
   VSPLAT_ERROR_FILE: nothing can be written (earlier checkpoints stay). VSPLAT_ERROR_INTERNAL: the loss is no longer a
   number; names step, tensor and the last good checkpoint. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_train(vsplat_device device, const char* config,
                                                       const vsplat_train_options* options,
                                                       vsplat_train_result* out_result);

typedef struct vsplat_train_plan_options {
  size_t size;
  double selected;        /* share of the voxels that are selected; 0: VSPLAT_TRAIN_ASSUME_SELECTED */
  const char* selection;  /* NULL, or a file of voxels, whose number is used instead */
  uint64_t intersections; /* of Gaussians with tiles in each picture; 0: eight for each Gaussian */
  int32_t bound;          /* not 0: assumes all voxels, and every Gaussian in every tile, regardless of the fields
                             above */
} vsplat_train_plan_options;
#define VSPLAT_TRAIN_PLAN_OPTIONS_INIT \
  { sizeof(vsplat_train_plan_options), 0.0, NULL, 0, 0 }

/* Plans the device memory of a training, including weights and optimiser state, without computing anything; `options`
   NULL: the defaults. If a step would not fit, the plan first recomputes activations in the backward, then draws
   pictures in tiles. If it still does not fit, `fits` is 0 and `peak` is the least it needs. Errors are those of
   vsplat_train. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_train_plan(vsplat_device device, const char* config,
                                                            const vsplat_train_plan_options* options,
                                                            vsplat_plan* out_plan);

/* Writes one run page about the trainings in these folders, running or done, as self-contained HTML: the curves of
   log.csv, the configuration, data and devices. For a single training it also shows the sheets, up to 12 MiB; for
   several the curves share the same axes. No device is needed. Missing or damaged parts of a folder are left out, and
   the page says so. VSPLAT_ERROR_FILE: a folder is not a training's, or the page cannot be written. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_train_report(const char* const* runs, size_t num_runs,
                                                              const char* path);

/* The configuration with every field, as JSON; `config` NULL: the defaults. Free the text with vsplat_text_free. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_train_config(const char* config, char** out_text);

#ifdef __cplusplus
}
#endif

#endif
