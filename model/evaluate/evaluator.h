// Scores of single objects, as one device computes them.
#pragma once
#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "model/base/image.h"
#include "model/base/scene.h"
#include "model/evaluate/evaluate.h"
#include "model/evaluate/evaluation_object.h"

namespace vsplat {

// Square pictures side by side, clamped, as the published protocol compares them.
class Strip {
 public:
  Strip(int edge, std::size_t count) : edge_(edge), image_(edge * static_cast<int>(count), edge, 3) {}

  void put(std::size_t place, const Image& picture) {
    for (int y = 0; y < edge_; ++y)
      std::transform(picture.at(0, y), picture.at(0, y) + row(), image_.at(static_cast<int>(place) * edge_, y),
                     [](float v) { return std::clamp(v, 0.0f, 1.0f); });
  }
  // Makes pixels white that the view does not show (EvaluationObject::shown).
  void leave_out(std::size_t place, const Image& shown) {
    for (int y = 0; y < shown.height; ++y)
      for (int x = 0; x < shown.width; ++x) {
        float* const pixel = image_.at(static_cast<int>(place) * edge_ + x, y);
        const float share = *shown.at(x, y);
        for (int c = 0; c < 3; ++c) pixel[c] = share * pixel[c] + (1 - share);
      }
  }
  Image at(std::size_t place) const {
    Image out(edge_, edge_, 3);
    for (int y = 0; y < edge_; ++y) std::copy_n(image_.at(static_cast<int>(place) * edge_, y), row(), out.at(0, y));
    return out;
  }
  const Image& image() const { return image_; }

 private:
  std::ptrdiff_t row() const { return static_cast<std::ptrdiff_t>(edge_) * 3; }

  int edge_;
  Image image_;
};

class Evaluator {
 public:
  Evaluator(const Evaluating& worker, const EvaluateOptions& options)
      : ctx_(worker.ctx),
        network_(worker.network),
        config_(worker.network.config()),
        lpips_(worker.lpips),
        options_(options) {}

  void check() const;
  // Edge of the compared pictures, in pixels.
  int compared_size() const {
    return options_.request.compared_size > 0 ? options_.request.compared_size : config_.image();
  }
  EvaluationObject load(const DataObject& object, std::vector<std::string>& skipped,
                        std::vector<std::string>& missing) const {
    return evaluation_object(object, config_.taken(), options_.request, options_.skip_bad ? &skipped : nullptr,
                             &missing);
  }
  // Means over the draws of noise.
  Scores score(const EvaluationObject& object) const;
  // A sheet of these objects side by side: their inputs, and below them the compared pictures.
  Image sheet(const std::vector<const DataObject*>& objects) const;

 private:
  struct Drawn {
    Strip truth, coarse, result;
    Scores poses;         // scores of poses and rays, of the network's time and result
    double selected = 0;  // a share
  };

  Drawn draw(const EvaluationObject& object, int noise_draw = 0) const;
  Scores score(const EvaluationObject& object, int noise_draw) const;
  Strip render_all(const DeviceGaussians& gaussians, const EvaluationObject& object, float near,
                   const std::optional<std::array<float, 3>>& mirror, const std::optional<Detail>& detail) const;
  Scene reconstructed(const EvaluationObject& object, const std::vector<int>& views) const;
  Strip render_refined(const EvaluationObject& object) const;
  Gaussians fitted(const Gaussians& level, const EvaluationObject& object, const std::vector<Camera>& cameras) const;

  Context& ctx_;
  const Network& network_;
  const AnyConfig& config_;
  const std::vector<const Lpips*>& lpips_;
  const EvaluateOptions& options_;
};

Scores mean_of(const std::vector<ObjectScores>& objects);
// Indices of the best, the median and the worst object, or fewer if there are not as many.
std::vector<std::size_t> typical(const std::vector<ObjectScores>& objects);

}  // namespace vsplat
