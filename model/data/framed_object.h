// An object of a data set as the network sees it: its cube, and its views at the network's size, as prepared by
// `reconstruct`.
#pragma once
#include <array>
#include <cstdint>

#include "model/data/data_set.h"

namespace vsplat {

struct FrameRequest {
  int image = 0;  // S, the network's input size
  Crop crop = Crop::automatic;
  PlacementRequest placement;                   // estimates use at most 16 views
  std::vector<std::string>* missing = nullptr;  // as for open_object()
  bool to_train_on = false;                     // as for open_object()
};

struct FramedObject {
  std::string name;
  Photographs photographs;  // as returned by open_object()
  Placement placement;
  std::string label = {};  // the object's name in errors

  int views() const { return static_cast<int>(photographs.set.views.size()); }
};

// Opens and places the object, and checks that the cube's centre is in most pictures. Errors and `skipped` as for
// open_object().
FramedObject frame_object(const DataObject& object, const FrameRequest& request,
                          std::vector<std::string>* skipped = nullptr);

// Logs a warning if the masks of most of `count` of its views seem to be inverted. Skips views that cannot be read;
// their user reports them.
void warn_of_inverted_masks(const FramedObject& object, int count);

// [S][S][4], straight alpha, 8 bits: 8-bit pictures at the network's size are stored without loss.
struct StoredView {
  std::vector<std::uint8_t> rgba;
  Camera camera;  // S x S, in the user's world
  bool opaque = false;
  // True if a mask or an alpha channel marks the object; the rest is background. If false, alpha is below 1 only
  // outside the photograph, where nothing is known.
  bool masked = false;
};

// Decodes one view. Error(file, format or input) names object, view and problem; a picture that shows nothing of the
// object (alpha 0 everywhere) is also an error.
StoredView store_view(const FramedObject& object, int view, const FrameRequest& request);

// Appends the view composited over a background, [S][S][3].
void composite(const StoredView& view, const std::array<float, 3>& background, std::vector<float>& out);

}  // namespace vsplat
