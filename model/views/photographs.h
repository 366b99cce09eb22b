// Photographs as listed, and one of them loaded: what it is placed by and what the network gets come from one reading.
#pragma once
#include <functional>
#include <optional>
#include <span>

#include "model/io/picture/image_file.h"
#include "model/io/views/view_set.h"
#include "model/views/auto_frame.h"
#include "model/views/mask_check.h"
#include "model/views/views.h"

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

// A picture's file, opened once. One of up to 16 million pixels is decoded at most once, when it is first needed, and
// kept; of a larger one the undecoded file is kept, and its rows are decoded whenever they are asked for.
class PhotographFile {
 public:
  explicit PhotographFile(const std::string& path);

  const ImageInfo& info() const { return info_; }
  // As it is to be shown where the orientation counts. This must outlive them.
  std::unique_ptr<PixelRows> rows(int turning = 1);

 private:
  std::optional<ImageFile> file_;  // until it is decoded to be kept
  ImageInfo info_;
  std::optional<Image> decoded_;
};

// Bytes of the host's memory that reading these takes at most, all loaded at once: files, decoded ones that are kept,
// and what decoding the largest holds. Of the files the headers are read. 0 where pictures are made.
double host_bytes_to_load(const Photographs& photographs);

// A view whose picture and mask are each opened once. `photographs` must outlive it.
class LoadedPhotograph {
 public:
  // Reads the picture's file; Error(file, format or input) as resolved_view().
  LoadedPhotograph(const Photographs& photographs, int view);

  // With all its intrinsics.
  const ListedView& listed() const { return listed_; }

  // What of the picture is the object: by its mask, else by its alpha; nothing where it has neither. Decodes what this
  // is seen in.
  std::optional<MaskExtent> extent();

  // The same in shares of its pixels; nothing where it has neither a mask nor alpha.
  std::optional<MaskShares> shares();

  // As the network gets it, its background still open.
  FramedView framed(const Framing& framing);

  // All of it, its longer side at most `longest` pixels (0: as it is).
  WholeView whole(int longest);
  // Decodes all of the picture and its mask, for the errors.
  void read_through();
  // Whether the picture says what of it is the object: by a mask or an alpha channel.
  bool is_masked();

 private:
  PictureNames names() const;
  // Valid while this is.
  std::unique_ptr<PixelRows> picture();
  std::unique_ptr<PixelRows> mask();  // of the picture's size; null where none is listed
  const Image& made_picture();

  const Photographs* photographs_;
  int view_;
  ListedView listed_;
  int turning_ = 1;                     // of turning_of()
  std::optional<PhotographFile> file_;  // never where pictures are made
  std::optional<PhotographFile> mask_file_;
  std::optional<Image> made_;
};

// check_masks() of those of these views that have a mask or alpha, where all have.
void check_masks_of(const Photographs& photographs, std::span<const int> views);

// Makes a problem (ListedView::problem) of what cannot be read of a view: its picture, its mask, or that they do not
// fit the camera. Decodes all of both. One warning counts them; Error where none is left.
void leave_out_unreadable(Photographs& photographs);

}  // namespace vsplat
