// An object of a data set as an evaluation uses it: pictures and cameras of the views that its protocol chooses.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "model/base/taken_views.h"
#include "model/data/framed_object.h"
#include "model/evaluate/evaluation_views.h"

namespace vsplat {

struct EvaluationRequest {
  Protocol protocol = Protocol::kmeans;
  std::uint64_t seed = 0;  // for random10
  int compared_size = 0;   // edge of the compared pictures in pixels; 0: the configuration's, like the inputs
  int inputs = 0;          // number of input views; 0: TakenViews::trained
  Crop crop = Crop::automatic;
  PlacementRequest placement;
};

struct EvaluationObject {
  std::string name;
  std::size_t inputs = 0;       // the first views are inputs, the others novel
  int compared_size = 0;        // edge of the novel views' pictures and cameras
  std::vector<Image> pictures;  // on white: inputs at the configuration's size, novel views at the compared one
  std::vector<Image> alphas;    // of each input, as PreparedView::alpha
  std::vector<bool> masked;     // of each input, as PreparedView::masked
  // For each novel view [S][S][1], the share of each pixel that its photograph shows. Empty if it shows all, or if a
  // mask or alpha channel marks the rest as background.
  std::vector<Image> shown;
  std::vector<Image> inputs_compared;  // the inputs again, at the compared size; empty if the sizes are equal
  std::vector<Camera> cameras;         // in the object's frame, each at its picture's size
  std::vector<std::size_t> nearest;    // for each novel view the index of the input view nearest by angle
  FramedObject framed;                 // its source
  std::vector<int> input_views;        // indices of the inputs among its photographs
  Similarity to_world;                 // from the object's frame

  std::size_t novel() const { return pictures.size() - inputs; }
  const Image& input_compared(std::size_t i) const {
    return inputs_compared.empty() ? pictures[i] : inputs_compared[i];
  }
};

// Uses the requested number of inputs, or fewer if the cameras have fewer distinct positions. Error(file, format or
// input) names object, view and problem. If `skipped` is given, bad views are added to it and replaced by others, as
// long as there are any. Listed views without a picture are always skipped, as in reconstruction, and added to
// `missing`.
EvaluationObject evaluation_object(const DataObject& object, const TakenViews& taken, const EvaluationRequest& request,
                                   std::vector<std::string>* skipped = nullptr,
                                   std::vector<std::string>* missing = nullptr);

}  // namespace vsplat
