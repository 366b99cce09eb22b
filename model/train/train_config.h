// A training, all of it but the data: the model, how long and how fast, what a step sees, and what is written when. One
// JSON object, stored in every checkpoint. The defaults are the paper's but for the model and the batch, which are what
// two CPU cores can do.
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
  std::uint64_t seed = 0;  // of the initial weights, of every choice and of all noise

  // A step: `accumulate` batches of `batch` objects each, whose gradients' mean is what the optimiser sees.
  Schedule schedule;
  long batch = 1;
  long accumulate = 1;
  // Of how many parts, as equal as they can be and in order, the gradients are computed each for itself and then summed
  // in the order of parts: several devices share them, and the bits do not depend on how many there are.
  long parts = 1;
  // adamw; or muon: Muon for the weights that are matrices, AdamW for the others (biases, norms, embeddings, the heads'
  // weights)
  std::string optimizer = "adamw";
  double beta1 = 0.9, beta2 = 0.95, eps = 1e-8, weight_decay = 0.05;
  double momentum = 0.95;    // Muon's
  double clip_norm = 0.5;    // of the gradients' norm
  double ssim_weight = 0.5;  // w in MSE + w (1 - SSIM), for each level
  double alpha_weight = 0;   // a in + a |alpha - the picture's|, in the mean over pixels of views that have a mask
                             // or alpha; in the gradients alone, not in what is reported. 0: none
  // Of LaRa's network. Until so many steps are done, its second level is left out. After so many, the loss has
  // distortion_weight times the mean distortion of the first level, and normal_weight times how far normals are from
  // those of the surface that the depths span, if it is of surfels.
  long fine_after = 0, surface_after = 0;
  double distortion_weight = 0, normal_weight = 0;
  double ema = 0;                   // decay of a moving average of the weights; 0: none
  std::vector<std::string> frozen;  // parameters whose names start with one of these are not trained

  // What an object shows: the number of input views is drawn anew for each, from inputs_min to inputs_max.
  long inputs_min = 4, inputs_max = 4;
  long novel = 4;                 // views beside them in the loss
  bool random_background = true;  // novel views lie on white, grey or black, drawn for each object; else on white
  std::string fit = "auto";       // how pictures are cropped: auto, object, crop, pad
  double half_size = 0;           // so much of the views of both kinds are drawn and compared in half the size; 0 to 1
  // The object's frame is turned by an angle of at most so much about any axis, and its cube larger by a factor, both
  // drawn for each object.
  double turn_degrees = 0;
  double cube_min = 1, cube_max = 1;
  // So much of the objects are mirrored, and have their red, green and blue exchanged, drawn for each: 0 to 1.
  double mirror = 0, shuffle_channels = 0;
  double rooms = 0;  // so much of the objects are in a room (data/interior.h), as where users mask nothing; 0 to 1
  // Deviation of the noise on the poses that the network is told of input views but the first, drawn anew for each
  // object and step (base/pose_noise.h): radians, and edges of the cube. What is drawn and compared knows none.
  double pose_noise = 0;
  double procedural = 0;  // so much of the objects are none of the data set, but drawn while training; 0 to 1

  // In steps; 0: never.
  long log_every = 10;
  long sheet_every = 500;
  long checkpoint_every = 500;
  long keep_checkpoints = 3;  // the newest; older ones are removed
  double cache_gib = 1;       // decoded pictures kept in memory

  bool operator==(const TrainConfig&) const = default;
};

// Whether Muon moves this parameter.
bool is_muons(const TrainConfig& config, const Parameter& parameter);

// Whether one of `frozen` starts this parameter's name.
bool is_frozen(const TrainConfig& config, const std::string& parameter);

// Refuses by name, with the value found, what cannot be trained.
void check(const TrainConfig& config, Status status = Status::usage);

// Every field, one a line; the model's in an object of its own.
std::string to_json(const TrainConfig& config);

// Absent fields take their defaults: inputs_min, inputs_max and novel the model's `views`, warmup usual_warmup() of the
// steps, tau_steps all of them, of LaRa's network fine_after a tenth of the steps, at most 5000, and of surfels
// surface_after as many as warm up usually, distortion_weight 1000 and normal_weight 0.2; the others those above.
// `model` is a name of config_names(), or an object of the configuration's fields over those of `base`, such a name of
// its `system`, "small" where it is absent. Unknown fields, wrong types and
// what cannot be trained are an Error(format) that names them.
TrainConfig train_config_from_json(const std::string& text);

// Trainings one after another, each of which begins with the weights of the one before: the objects of the field
// `stages`, whose fields are over those that stand beside it (of `model`, single fields over its fields), and `seed`,
// where a stage has none, one more for each. Without that field: the one training. Errors name the stage.
std::vector<TrainConfig> train_stages_from_json(const std::string& text);
// What train_stages_from_json() takes: of one stage as to_json(config) has it.
std::string to_json(const std::vector<TrainConfig>& stages);

// SHA-256 of to_json(): equal for equal configurations, however they were written.
std::string hash_of(const TrainConfig& config);

}  // namespace vsplat
