/* Training from posed pictures. Part of vsplat.h, which includes it and whose conventions hold: handles, statuses,
   structs with their size. */
#ifndef VSPLAT_TRAIN_H
#define VSPLAT_TRAIN_H

#include <vsplat/device.h>
#include <vsplat/reconstruct.h>
#include <vsplat/status.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Means over the steps since the last report; the two counts are the largest. */
typedef struct vsplat_train_progress {
  size_t size;
  int64_t step, steps;         /* done, and of the whole training */
  double learning_rate;        /* of the last step, as the temperature */
  double temperature;          /* of the Gumbel-Sigmoid */
  double loss;                 /* of both levels */
  double psnr, psnr_coarse;    /* dB, of the novel views; of the fine (or only) level, and of the coarse one */
  double selected;             /* share of the voxels, or primitives */
  double gradient_norm;        /* before it is clipped */
  uint64_t most_selected;      /* voxels of an object */
  uint64_t most_intersections; /* of Gaussians with a picture's tiles */
  double seconds;              /* of this run so far */
  double objects_per_second;
  double seconds_left; /* by the steps of this run in which no kernel was compiled; 0: there was none yet */
} vsplat_train_progress;

/* The share of the voxels, of LaRa's and GenDen's networks that of the primitives, that a training takes for selected
   where nothing else is said. */
#define VSPLAT_TRAIN_ASSUME_SELECTED 0.25

typedef struct vsplat_train_options {
  size_t size;
  const char* const* data; /* data sets: folders that vsplat_object_names' objects are in; none are needed where all
                              objects are procedural */
  size_t num_data;
  const char* output; /* the run's folder, made where there is none */
  int32_t resume;     /* not 0: go on from the newest good checkpoint in it */
  int32_t skip_bad;   /* not 0: pass over and count data that cannot be read */
  void (*on_progress)(void* user, const vsplat_train_progress* progress); /* may be NULL, as those below */
  void (*on_message)(void* user, const char* text);                       /* what was written */
  int32_t (*go_on)(void* user); /* asked after every step; 0: a checkpoint is written and the training ends */
  void* user;
  const char* selection;  /* NULL, or a file of voxels as vsplat_scene_save_selection writes it: these are refined in
                             every step, whatever the network would choose */
  double assume_selected; /* share of the voxels that memory is made for at first; 0:
                             VSPLAT_TRAIN_ASSUME_SELECTED */
  uint64_t assume_intersections; /* in a picture, for the check before the start; 0: eight tiles for each Gaussian */
  const char* init;              /* NULL, or a model file whose weights the training begins with: its model must be the
                                    configuration's. Not read where a checkpoint is gone on from. */
  const int64_t* extend; /* with `resume`: so many steps after the configuration's, each number of them with a rise of
                            the learning rate and a cosine of its own; the temperature stays where it was. The same
                            numbers again go on with the same extension, or find it done: to extend further, give them
                            and one more. NULL: as the checkpoint was extended */
  size_t num_extend;
  const char* textures; /* NULL, or a folder of pictures that procedural objects and the walls of rooms are covered
                           with, half of their parts with one of them each */
  /* [num_more_devices] devices or streams that compute parts of each step beside the call's device, where the
     configuration's `parts` is more than 1; the call has them, too. On devices of one kind the bits are those of one of
     them. One that fails is told as a warning, and the others go on. NULL: none */
  const vsplat_device* more_devices;
  size_t num_more_devices;
  int32_t ranks; /* not 0: the ranks of vsplat/ranks.h compute parts of each step, each on its devices; as many parts as
                    there are, or more. Rank 0 alone writes, calls functions and has the errors; on the others the call
                    ends when it does there, with VSPLAT_OK */
} vsplat_train_options;
#define VSPLAT_TRAIN_OPTIONS_INIT                                                                                 \
  {                                                                                                               \
    sizeof(vsplat_train_options), NULL, 0, NULL, 0, 0, NULL, NULL, NULL, NULL, NULL, 0.0, 0, NULL, NULL, 0, NULL, \
        NULL, 0, 0                                                                                                \
  }

typedef struct vsplat_train_result {
  size_t size;
  int64_t step;    /* steps done */
  int32_t stopped; /* not 0: go_on said so */
  uint64_t bad;    /* views and objects passed over; of several ranks by this one */
  uint64_t peak;   /* the most device memory that was held, bytes */
} vsplat_train_result;
#define VSPLAT_TRAIN_RESULT_INIT \
  { sizeof(vsplat_train_result), 0, 0, 0, 0 }

/* Where the configuration has `stages`, one training after another: see TRAINING.md of the documents. Trains, from the
   beginning or from a checkpoint, and writes into `output`: config.json, log.csv, sheets/, the newest checkpoints, each
   whole or not at all, and with them model.safetensors, which vsplat_model_load takes. Beside them, as it goes and at
   the end, report.html, the page of vsplat_train_report about it, and record.json, which that reads; it goes on with a
   warning where these two cannot be written. `config`: a JSON object, see vsplat_train_config. `options` are needed,
   for `output`; `out_result` may be NULL. The same configuration, data and device give the same bits, however often the
   training was interrupted. Callbacks are called on this thread and may not use the device. VSPLAT_ERROR_USAGE where
   the folder holds checkpoints and `resume` is 0, or checkpoints of another configuration, or of a device that ran with
   another table of tuned parameters (vsplat_device_info.tuning); VSPLAT_ERROR_FORMAT for a field of the configuration,
   or where `init` is of another model; VSPLAT_ERROR_INPUT for data, naming object, view and field; VSPLAT_ERROR_MEMORY
   before the start, with both figures, where vsplat_train_plan says that it does not fit; VSPLAT_ERROR_FILE where
   nothing can be written (earlier checkpoints stay); VSPLAT_ERROR_INTERNAL where the loss is no longer a number, naming
   step, tensor and the last good checkpoint. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_train(vsplat_device device, const char* config,
                                                       const vsplat_train_options* options,
                                                       vsplat_train_result* out_result);

typedef struct vsplat_train_plan_options {
  size_t size;
  double selected;        /* share of the voxels that are selected; 0: VSPLAT_TRAIN_ASSUME_SELECTED */
  const char* selection;  /* NULL, or a file of voxels, whose number counts instead */
  uint64_t intersections; /* of Gaussians with tiles in each picture; 0: eight for each Gaussian */
  int32_t bound;          /* not 0: all voxels, and every Gaussian in every tile, whatever stands above */
} vsplat_train_plan_options;
#define VSPLAT_TRAIN_PLAN_OPTIONS_INIT \
  { sizeof(vsplat_train_plan_options), 0.0, NULL, 0, 0 }

/* Device memory of a training, weights and optimiser's state included, without computing anything; `options` NULL: the
   defaults. Where a step would not fit, what it can do without is left out first: activations are computed a second
   time in the backward, then pictures are drawn in parts. Where it does not fit for all that, `fits` is 0 and `peak`
   what it takes at the least. Errors as vsplat_train has them. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_train_plan(vsplat_device device, const char* config,
                                                            const vsplat_train_plan_options* options,
                                                            vsplat_plan* out_plan);

/* Writes one page about trainings whose folders these are, at work or done, in HTML that fetches nothing: the curves of
   log.csv, the configuration, data and devices. Of one training also its sheets, as far as they are no more than 12 MiB;
   of several the curves lie on the same axes. No device is needed. What is missing or damaged in a folder is left out,
   and told in the page. VSPLAT_ERROR_FILE where one is no training's folder, or where the page cannot be written. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_train_report(const char* const* runs, size_t num_runs,
                                                              const char* path);

/* The configuration with every field, as JSON; `config` NULL: the defaults. vsplat_text_free frees the text. */
VSPLAT_API VSPLAT_NODISCARD vsplat_status vsplat_train_config(const char* config, char** out_text);

#ifdef __cplusplus
}
#endif

#endif
