// Measures how well a model reconstructs the objects of data sets: some views of each are the input, pictures from
// other views are compared.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/evaluate/evaluation_object.h"
#include "model/metrics/lpips_distance.h"
#include "model/networks/network.h"
#include "runtime/system/ranks.h"

namespace vsplat {

// Scores over all novel views of an object on white, laid side by side. PSNR in dB for a peak of 1, from their common
// mean squared error; SSIM in windows of 11 x 11. Renderings are clamped to [0,1]. Pictures have the size
// EvaluationRequest::compared_size: the truth is resampled to it by area, and the result is rendered in it. Pixels
// outside a photograph without mask or alpha are not compared: all pictures are white there, and PSNR only covers the
// photograph.
struct Scores {
  double psnr = 0, psnr_coarse = 0;         // of the model's result, and of its coarse level
  double ssim = 0;                          // of the result
  double psnr_white = 0, psnr_nearest = 0;  // of white pictures, and of the input view nearest by angle
  double selected = 0;                      // selected voxels (those with a kept primitive), as a share of 0 to 1
  double lpips_alex, lpips_vgg;             // of the result; NaN if not requested
  // Deviation of the input poses that the network received from the listed ones (base/pose_noise.h), and of its
  // predicted rays from those of the listed poses; NaN without noise, and if no rays are predicted.
  double pose_degrees, pose_distance, ray_degrees, ray_moment;
  double gaussians = 0;  // of the network's result
  double seconds = 0;    // from the pictures on the device to the network's result there

  Scores();
};

struct ObjectScores {
  std::string name;
  Scores scores;
};

struct EvaluateOptions {
  EvaluationRequest request;
  bool skip_bad = false;      // skip views and objects that cannot be read, instead of an Error
  bool sheet = false;         // make one
  bool refine = false;        // fit the result to the inputs, and only these
  long planned_selected = 0;  // as in ForwardOptions
  // Noise on the poses that the network receives of the inputs but the first, in the object's frame: its standard
  // deviation, in radians and edges of the cube, and the number of draws; an object's scores are the means. Determined
  // by the request's seed and the object's name, independent of the model. Pictures are compared from the poses as
  // listed. Not with `refine`.
  double pose_noise = 0;
  int pose_draws = 1;
  int supersample = 0;  // samples along a pixel's edge; 0: depends on the inputs' pixels (render/supersample.h)
  // Called before each object with its name and the share of the work that has begun; one call at a time, on any
  // worker's thread. May throw to cancel.
  std::function<void(const std::string& object, double done)> progress;
  Ranks* ranks = nullptr;  // processes that share the objects; null: this one alone
  // Called after each object, in order: the caller keeps finished results if a later object fails, or on cancellation.
  // With several ranks only rank 0 calls it, after all are done.
  std::function<void(const ObjectScores&)> on_object;
};

struct Evaluation {
  std::vector<ObjectScores> objects;  // in the data set's order
  Scores mean;                        // mean of every score over the objects
  std::size_t skipped = 0;            // objects skipped; a warning was logged for each, and for each skipped view
  Image sheet;  // best, median and worst by PSNR side by side; rows: input, truth, coarse, result, up to 4 views each
};

// A worker: the network on a device.
struct Evaluating {
  Context& ctx;
  const Network& network;
  std::vector<const Lpips*> lpips = {};  // on the same device; at most one for each LPIPS network
};

// Waits for the device. Error(file, format or input) names object, view and problem; with skip_bad only if no object is
// left.
Evaluation evaluate(Context& ctx, const Network& network, const DataSet& data, const EvaluateOptions& options);

// The same, with the objects shared out over several workers: one whose device fails gets no more (`lost` as in
// ShareOut). With several ranks rank 0 returns the whole evaluation and throws the errors; the others return their own
// part.
Evaluation evaluate(const std::vector<Evaluating>& workers, const DataSet& data, const EvaluateOptions& options,
                    const std::function<void(std::size_t worker, const Error& error)>& lost = {});

}  // namespace vsplat
