// Photographs as listed, and one of them loaded: what it is placed by and what the network gets come from one reading.
#pragma once
#include <functional>
#include <optional>

#include "model/input/auto_frame.h"
#include "model/input/views.h"
#include "model/io/image_file.h"
#include "model/io/view_set.h"

namespace vsplat {

// Photographs as listed.
struct Photographs {
  ViewSet set;
  // Makes the picture of a view (by its index; 3 or 4 channels). Empty: pictures are in the views' files.
  std::function<Image(int)> picture = {};
};

// How the picture of a view is to be turned to be what its camera saw: 1, for as it is stored, or the orientation that
// the file states. Which of them the listed size tells where they differ in it; COLMAP reads pictures as they are
// stored. Error(input) where the file states an orientation and nothing tells whether the pose is of the picture with
// it or without.
int turning_of(const ViewSet& set, const ListedView& view, const ImageInfo& info);

// The listed view with all its intrinsics: what it leaves open comes from its picture's size. Of a picture's file the
// header alone is read.
ListedView resolved_view(const Photographs& photographs, int view);

// A view whose picture and mask are each opened once and decoded at most once, when they are first needed. Where it is
// not asked for its extent, it holds the undecoded file. `photographs` must outlive it.
class LoadedPhotograph {
 public:
  // Reads the picture's file; Error(file, format or input) as resolved_view().
  LoadedPhotograph(const Photographs& photographs, int view);

  // With all its intrinsics.
  const ListedView& listed() const { return listed_; }

  // What of the picture is the object: by its mask, else by its alpha; nothing where it has neither. Decodes what this
  // is seen in.
  std::optional<MaskExtent> extent();

  // As the network gets it, its background still open.
  FramedView framed(const Framing& framing);

  // All of it, its longer side at most `longest` pixels (0: as it is).
  WholeView whole(int longest);
  // Whether the picture says what of it is the object: by a mask or an alpha channel.
  bool is_masked();

 private:
  PictureNames names() const;
  const Image& picture();
  const Image* mask();  // null where none is listed

  const Photographs* photographs_;
  int view_;
  ListedView listed_;
  std::optional<ImageFile> file_;  // until it is decoded; never where pictures are made
  ImageInfo info_;                 // of the file
  int turning_ = 1;                // of turning_of()
  std::optional<Image> picture_, mask_;
};

}  // namespace vsplat
