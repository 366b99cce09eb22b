// A training's configuration: the model, the schedule, the data of a step, and the output. It is a JSON object, which
// every checkpoint stores. The defaults are the paper's, except for the model and the batch, which suit two CPU cores.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "model/networks/params/any_config.h"
#include "model/networks/params/config.h"
#include "model/train/schedule.h"

namespace vsplat {

struct TrainConfig {
  AnyConfig model = named_config("small");
  std::uint64_t seed = 0;  // of the initial weights and of all random choices and noise

  // A step has `accumulate` batches of `batch` objects each. The optimiser uses the mean of their gradients.
  Schedule schedule;
  long batch = 1;
  long accumulate = 1;
  // Number of shards of a step, in order and of nearly equal size. Each shard's gradients are computed separately and
  // then summed in order. Several devices share the shards; the bits do not depend on the number of devices.
  long parts = 1;
  // "adamw" or "muon". Muon updates the weights that are matrices, and AdamW the others (biases, norms, embeddings, the
  // heads' weights).
  std::string optimizer = "adamw";
  double beta1 = 0.9, beta2 = 0.95, eps = 1e-8, weight_decay = 0.05;
  double momentum = 0.95;    // Muon
  double clip_norm = 0.5;    // limit of the gradients' norm
  double ssim_weight = 0.5;  // w in MSE + w (1 - SSIM), for each level
  // a in + a |alpha - the picture's|, averaged over the pixels of views that have a mask or alpha; affects the
  // gradients, not the reported loss. 0: none
  double alpha_weight = 0;
  // b in + b times the mean, over a level's Gaussians, of ln(1 + opacity / 0.05), which makes a few opaque Gaussians of
  // many faint ones; affects the gradients, not the reported loss. 0: none
  double sparsity_weight = 0;
  // LaRa's network. The second level is skipped for `fine_after` steps. After `surface_after` steps, the loss of a
  // first level of surfels also has distortion_weight times the mean distortion, and normal_weight times the deviation
  // of the normals from those of the surface that the depths span.
  long fine_after = 0, surface_after = 0;
  double distortion_weight = 0, normal_weight = 0;
  double ema = 0;                   // decay of a moving average of the weights; 0: none
  std::vector<std::string> frozen;  // parameters whose names start with one of these are not trained

  // Views of an object. The number of input views is drawn for each object, from inputs_min to inputs_max.
  long inputs_min = 4, inputs_max = 4;
  double first_listed = 0;        // share of objects whose inputs are the first of their groups, as `evaluate` has them
  long novel = 4;                 // further views, in the loss only
  bool random_background = true;  // novel views over white, grey or black, drawn for each object; else over white
  std::string crop = "auto";      // "fit" in a file, how pictures are cropped: auto, object, crop, pad
  double half_size = 0;           // share of views, input and novel, rendered and compared at half size; 0 to 1
  // The object's frame is rotated by at most `turn_degrees` about a random axis, and its cube is scaled by a factor
  // from cube_min to cube_max, both drawn for each object.
  double turn_degrees = 0;
  double cube_min = 1, cube_max = 1;
  // Shares of the objects that are mirrored, and that have permuted colour channels, drawn for each: 0 to 1.
  double mirror = 0, shuffle_channels = 0;
  // The share of objects inside a box with walls (data/interior.h), like photographs without masks: 0 to 1.
  double rooms = 0;
  // Deviation of the noise on the poses that the network receives for all input views but the first, drawn for each
  // object and step (base/pose_noise.h): radians, and edges of the cube. Targets have accurate poses.
  double pose_noise = 0;
  // share of the objects that are generated during training instead of read from the data set; 0 to 1
  double procedural = 0;

  // Intervals in steps; 0: never.
  long log_every = 10;
  long sheet_every = 500;
  long checkpoint_every = 500;
  long keep_checkpoints = 3;  // the newest; older ones are deleted
  double cache_gib = 1;       // memory for cached pictures

  bool operator==(const TrainConfig&) const = default;
};

// Whether Muon updates this parameter.
bool is_muons(const TrainConfig& config, const Parameter& parameter);

// Whether this parameter's name starts with one of `frozen`.
bool is_frozen(const TrainConfig& config, const std::string& parameter);

// Refuses a configuration that cannot be trained. The error names the field and its value.
void check(const TrainConfig& config, Status status = Status::usage);

// All fields, one a line; the model's fields in an object of their own.
std::string to_json(const TrainConfig& config);

// Defaults of absent fields: inputs_min, inputs_max and novel are the model's `views`, warmup is usual_warmup() of the
// steps, and tau_steps all steps. For LaRa's network, fine_after is a tenth of the steps, at most 5000. For surfels,
// surface_after is usual_warmup() of the steps, distortion_weight 1000 and normal_weight 0.2. The other defaults are
// those above. `model` is one of config_names(), or an object of configuration fields that override those of `base`;
// `base` is one of the names of its `system`, "small" if absent. Error(format) names unknown fields, wrong types and
// values that cannot be trained.
TrainConfig train_config_from_json(const std::string& text);

// Successive trainings, each of which starts with the weights of the one before: the objects of the field `stages`. A
// stage's fields override those beside `stages` (`model` is merged field by field). A stage without `seed` has the seed
// of the one before plus one. Without `stages`, there is one training. Errors name the stage.
std::vector<TrainConfig> train_stages_from_json(const std::string& text);
// Writes what train_stages_from_json() reads; for one stage the text of to_json(config).
std::string to_json(const std::vector<TrainConfig>& stages);

// SHA-256 of to_json(): equal configurations have equal hashes, however they were written.
std::string hash_of(const TrainConfig& config);

}  // namespace vsplat
