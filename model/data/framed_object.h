// An object of a data set as the network sees it: where its cube is, and its views in the network's size, as
// `reconstruct` makes them.
#pragma once
#include <array>
#include <cstdint>

#include "model/data/data_set.h"

namespace vsplat {

struct FrameRequest {
  int image = 0;  // S, the network's
  Fit fit = Fit::automatic;
  PlacementRequest placement;                   // what is estimated is from 16 views at most
  std::vector<std::string>* missing = nullptr;  // as open_object() has it
  bool to_train_on = false;                     // so, too
};

struct FramedObject {
  std::string name;
  Photographs photographs;  // as open_object() gives them
  Placement placement;
  std::string told = {};  // how errors call it

  int views() const { return static_cast<int>(photographs.set.views.size()); }
};

// Opens, places and checks that the cube's centre is in most pictures. Errors and `skipped` as open_object() has them.
FramedObject frame_object(const DataObject& object, const FrameRequest& request,
                          std::vector<std::string>* skipped = nullptr);

// A warning where the masks of most of `count` of its views seem to be inverted. Views that cannot be read are passed
// over: whoever uses them tells of them.
void warn_of_inverted_masks(const FramedObject& object, int count);

// [S][S][4], straight alpha, 8 bits: nothing is lost of 8-bit pictures in the network's size.
struct StoredView {
  std::vector<std::uint8_t> rgba;
  Camera camera;  // S x S, in the user's world
  bool opaque = false;
  // A mask or an alpha channel says what the object is: beside it is background. Else alpha is below 1 only where the
  // photograph ends, and nothing is known of what is there.
  bool masked = false;
};

// Decodes one. Error(file, format or input) names object, view and what is wrong; a picture that shows nothing of the
// object (alpha 0 everywhere) is an error, too.
StoredView store_view(const FramedObject& object, int view, const FrameRequest& request);

// [S][S][3] over a background, appended.
void composite(const StoredView& view, const std::array<float, 3>& background, std::vector<float>& out);

}  // namespace vsplat
