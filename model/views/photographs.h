// Listed photographs, and a loaded photograph: placement and network input come from a single read of its file.
#pragma once
#include <functional>
#include <optional>
#include <span>

#include "model/io/picture/image_file.h"
#include "model/io/views/view_set.h"
#include "model/views/auto_frame.h"
#include "model/views/mask_check.h"
#include "model/views/view_depth.h"
#include "model/views/views.h"

namespace vsplat {

// What is outside a mask. Alpha in a picture always marks the object.
enum class MaskUse {
  object,  // nothing: the mask shows the object
  ignore   // something unknown, which takes no part
};

// Photographs as listed.
struct Photographs {
  ViewSet set;
  // Makes the picture of a view (by its index; 3 or 4 channels). If empty, pictures are read from the views' files.
  std::function<Image(int)> picture = {};
  ViewDepths depths = {};  // empty: of no view
  MaskUse masks = MaskUse::object;
  bool invert_masks = false;  // black is inside
};

// The orientation to apply to a view's picture so that it matches the camera: 1 (as stored) or the orientation stated
// in the file. The listed size decides if the two differ in size; COLMAP reads pictures as stored. Error(input) if the
// file states an orientation and the size does not decide.
int turning_of(const ViewSet& set, const ListedView& view, const ImageInfo& info);

// The listed view with all intrinsics; the picture's size determines the unknown ones. Reads only the header of a
// picture file.
ListedView resolved_view(const Photographs& photographs, int view);

// A picture file, opened once. A picture of up to 16 million pixels is decoded at most once, when first needed, and
// cached. For larger ones the undecoded file is cached, and rows are decoded with each call.
class PhotographFile {
 public:
  explicit PhotographFile(const std::string& path);

  const ImageInfo& info() const { return info_; }
  // The rows with the orientation `turning` applied. This must outlive them. `once`: the picture is read once, so it is
  // decoded row by row, and cached only if it is already.
  std::unique_ptr<PixelRows> rows(int turning = 1, bool once = false);

 private:
  std::optional<ImageFile> file_;  // until the decoded picture replaces it
  ImageInfo info_;
  std::optional<Image> decoded_;
};

// Upper limit on the host memory, in bytes, to hold all these pictures loaded at once: files, cached decoded pictures,
// and the working memory for decoding the largest. Reads the files' headers. 0 if pictures are made in memory.
double host_bytes_to_load(const Photographs& photographs);

// A view whose picture and mask are each opened once. `photographs` must outlive it.
class LoadedPhotograph {
 public:
  // Reads the picture's file; Error(file, format or input) as resolved_view().
  LoadedPhotograph(const Photographs& photographs, int view);

  // With all intrinsics.
  const ListedView& listed() const { return listed_; }

  // The object's extent in the picture, from its mask or else its alpha; nothing if it has neither. Decodes the mask or
  // picture.
  std::optional<MaskExtent> extent();

  // The object's shares of the pixels; nothing if there is neither a mask nor alpha.
  std::optional<MaskShares> shares();

  // The network's input, without a background yet.
  FramedView framed(const Framing& framing);

  // The whole picture, its longer side at most `longest` pixels (0: unchanged). With MaskUse::ignore, pixels that the
  // mask does not cover are unknown. Picture and mask are decoded row by row, and not cached.
  WholeView whole(int longest);
  // The depths of the pixels of what whole() returned, in the world's unit; empty if there are none.
  std::vector<float> depths(const WholeView& whole) const;
  // Decodes the whole picture and mask, to detect errors.
  void read_through();
  // Whether a mask or an alpha channel marks the object. extent(), shares() and framed() use only such masks.
  bool is_masked();

 private:
  PictureNames names() const;
  // Valid as long as this object.
  std::unique_ptr<PixelRows> picture(bool once = false);
  std::unique_ptr<PixelRows> mask(bool once = false);  // white inside; null if none is listed
  std::unique_ptr<PixelRows> object_mask();            // null if it is to be ignored
  bool has_object_mask() const { return listed_.mask && photographs_->masks == MaskUse::object; }
  const Image& made_picture();

  const Photographs* photographs_;
  int view_;
  ListedView listed_;
  int turning_ = 1;                     // result of turning_of()
  std::optional<PhotographFile> file_;  // empty if pictures are made in memory
  std::optional<PhotographFile> mask_file_;
  std::optional<Image> made_;
};

// Runs check_masks() on these views, if all of them have a mask or alpha.
void check_masks_of(const Photographs& photographs, std::span<const int> views);

// Sets ListedView::problem of views whose picture or mask cannot be read, or does not fit the camera. Decodes both
// completely. One warning counts them; Error if none is left.
void leave_out_unreadable(Photographs& photographs);

}  // namespace vsplat
