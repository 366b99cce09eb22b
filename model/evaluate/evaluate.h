// How well a model reconstructs the objects of data sets: some views of each go in, pictures from others are compared.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "model/evaluate/evaluation_object.h"
#include "model/metrics/lpips.h"
#include "model/networks/network.h"
#include "runtime/system/ranks.h"

namespace vsplat {

// Of all novel views of an object on white, laid side by side. PSNR in dB for a peak of 1, from their mean squared
// error together; SSIM in windows of 11 x 11. What is drawn is clamped to [0,1]. Pictures have EvaluationRequest's
// judged size: the truth is resampled to it by area, and the result is drawn in it. Where a photograph without mask or
// alpha ends, nothing is compared: there all pictures are white, and PSNR is over what it shows.
struct Scores {
  double psnr = 0, psnr_coarse = 0;         // of the model's result, and of its coarse level
  double ssim = 0;                          // of the result
  double psnr_white = 0, psnr_nearest = 0;  // of white pictures, and of the input view nearest by angle
  double selected = 0;                      // voxels selected (with a kept primitive), a share of 0 to 1
  double lpips_alex, lpips_vgg;             // of the result; NaN where that was not asked for
  // How far what the network was told of the inputs' poses is from what is listed (base/pose_noise.h), and its
  // predicted rays from the listed poses'; NaN without noise, and where none are predicted.
  double pose_degrees, pose_distance, ray_degrees, ray_moment;
  double gaussians = 0;  // of the network's result
  double seconds = 0;    // that the network took, from the pictures on the device to its result there

  Scores();
};

struct ObjectScores {
  std::string name;
  Scores scores;
};

struct EvaluateOptions {
  EvaluationRequest request;
  bool skip_bad = false;      // views and objects that cannot be read are passed over, else an Error
  bool sheet = false;         // make one
  bool refine = false;        // the result is moved towards the inputs, and them alone
  long planned_selected = 0;  // as ForwardOptions have it
  // Noise on the poses that the network is told of the inputs but the first, in the object's frame: its deviation, in
  // radians and edges of the cube, and how often it is drawn; an object's numbers are the means. By the request's seed
  // and the object's name, whatever the model: what is compared is drawn from the poses as listed. Not with `refine`.
  double pose_noise = 0;
  int pose_draws = 1;
  int supersample = 0;  // samples along a pixel's edge; 0: by the inputs' own pixels (render/supersample.h)
  // Called before each object with its name and the share of the work that is begun; one at a time, on any of the
  // workers' threads. May throw to cancel.
  std::function<void(const std::string& object, double done)> progress;
  Ranks* ranks = nullptr;  // processes that share the objects; none: this one alone
  // Called after each object, in order: what is done stays the caller's where a later one is an error, or it is
  // cancelled. Of several ranks by rank 0 alone, when all are done.
  std::function<void(const ObjectScores&)> on_object;
};

struct Evaluation {
  std::vector<ObjectScores> objects;  // in the data set's order
  Scores mean;                        // of every number over the objects
  std::size_t skipped = 0;            // objects passed over; each was told as a warning, as was each view
  Image sheet;  // best, median and worst by PSNR side by side; rows: input, truth, coarse, result, up to 4 views each
};

// One that evaluates: the network on a device.
struct Evaluating {
  Context& ctx;
  const Network& network;
  std::vector<const Lpips*> lpips = {};  // on the same device; at most one of each network
};

// Waits. Error(file, format or input) names object, view and what is wrong; with skip_bad only where no object is left.
Evaluation evaluate(Context& ctx, const Network& network, const DataSet& data, const EvaluateOptions& options);

// The same, the objects shared out over several: one whose device fails gets no more of them (`lost`, as ShareOut's).
// Of several ranks rank 0 has the whole and the errors, the others what they did.
Evaluation evaluate(const std::vector<Evaluating>& workers, const DataSet& data, const EvaluateOptions& options,
                    const std::function<void(std::size_t worker, const Error& error)>& lost = {});

}  // namespace vsplat
