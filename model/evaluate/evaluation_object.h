// An object of a data set as an evaluation needs it: pictures and cameras of the views that its protocol takes.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "model/data/framed_object.h"
#include "model/evaluate/evaluation_views.h"
#include "model/networks/params/config_fields.h"

namespace vsplat {

struct EvaluationRequest {
  Protocol protocol = Protocol::kmeans;
  std::uint64_t seed = 0;  // of random10
  int judged = 0;          // edge in pixels of what is compared; 0: the configuration's, as the inputs have it
  int inputs = 0;          // how many go in; 0: TakenViews::trained
  Fit fit = Fit::automatic;
  PlacementRequest placement;
};

struct EvaluationObject {
  std::string name;
  std::size_t inputs = 0;       // the first so many are input views, the others novel ones
  int judged = 0;               // edge of the novel views' pictures and cameras
  std::vector<Image> pictures;  // on white: inputs of the configuration's size, novel views of the judged one
  // Of each novel view [S][S][1], how much of a pixel its photograph shows; empty where that is all of it, or a mask or
  // alpha channel says that what it does not show is background.
  std::vector<Image> shown;
  std::vector<Image> inputs_judged;  // the inputs once more, of the judged size; empty where the sizes are equal
  std::vector<Camera> cameras;       // in the object's frame, each of its picture's size
  std::vector<std::size_t> nearest;  // for each novel view the place of the input view nearest to it by angle
  FramedObject framed;               // what it was made of
  std::vector<int> input_views;      // the inputs' places in its photographs
  Similarity to_world;               // from the object's frame

  std::size_t novel() const { return pictures.size() - inputs; }
  const Image& input_judged(std::size_t i) const { return inputs_judged.empty() ? pictures[i] : inputs_judged[i]; }
};

// As many inputs as are asked for, fewer where the cameras are in fewer places. Error(file, format or input) names
// object, view and what is wrong. Where `skipped` is given, bad views are added to it and others taken, as long as any
// are left. Listed views without a picture are always passed over, as reconstructing does, and told in `missing`.
EvaluationObject evaluation_object(const DataObject& object, const TakenViews& taken, const EvaluationRequest& request,
                                   std::vector<std::string>* skipped = nullptr,
                                   std::vector<std::string>* missing = nullptr);

}  // namespace vsplat
