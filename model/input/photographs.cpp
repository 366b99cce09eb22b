#include "model/input/photographs.h"

#include <filesystem>
#include <utility>

#include "runtime/fail.h"

namespace vsplat {
namespace {

// The size of the picture once it is turned.
std::pair<int, int> turned_size(const ImageInfo& info, int turning) {
  return turning >= 5 ? std::pair{info.height, info.width} : std::pair{info.width, info.height};
}

}  // namespace

int turning_of(const ViewSet& set, const ListedView& view, const ImageInfo& info) {
  std::error_code error;
  if (info.orientation == 1 || std::filesystem::is_directory(set.source, error)) return 1;  // a folder: COLMAP's
  const Camera& c = view.camera;
  const bool turned = info.orientation >= 5 && c.width > 0 && c.height > 0 && c.width != c.height;
  if (turned && (c.width > c.height) == (info.width > info.height)) return 1;
  if (turned) return info.orientation;
  fail(Status::input,
       "{}: the picture states EXIF orientation {}, and {} does not tell whether its pose is of the picture turned so "
       "or as it is stored: store it turned (`mogrify -auto-orient`), or take the tag away (`exiftool -Orientation=`)",
       view.picture.string(), info.orientation, set.source.string());
}

ListedView resolved_view(const Photographs& photographs, int index) {
  ListedView view = photographs.set.views[index];
  if (photographs.picture) {
    if (is_resolved(view)) return view;  // its picture's size is looked at where it is made
    const Image picture = photographs.picture(index);
    resolve_intrinsics(view, picture.width, picture.height);
    return view;
  }
  const ImageInfo info = read_image_info(view.picture.string());
  const auto [width, height] = turned_size(info, turning_of(photographs.set, view, info));
  resolve_intrinsics(view, width, height);
  return view;
}

LoadedPhotograph::LoadedPhotograph(const Photographs& photographs, int view)
    : photographs_(&photographs), view_(view), listed_(photographs.set.views[view]) {
  if (!photographs.picture) {
    file_.emplace(listed_.picture.string());
    info_ = file_->info();
    turning_ = turning_of(photographs.set, listed_, info_);
    const auto [width, height] = turned_size(info_, turning_);
    resolve_intrinsics(listed_, width, height);
  } else if (!is_resolved(listed_)) {
    resolve_intrinsics(listed_, picture().width, picture().height);
  }
}

const Image& LoadedPhotograph::picture() {
  if (!picture_) {
    picture_ = file_ ? oriented(file_->decode(), turning_) : photographs_->picture(view_);
    file_.reset();
  }
  return *picture_;
}

const Image* LoadedPhotograph::mask() {
  if (!listed_.mask) return nullptr;
  if (!mask_) mask_ = read_mask(listed_.mask->string());
  return &*mask_;
}

std::optional<MaskExtent> LoadedPhotograph::extent() {
  if (const Image* seen = mask()) return mask_extent(*seen);
  if (file_ && !info_.alpha) return std::nullopt;
  if (picture().channels != 4) return std::nullopt;
  return mask_extent(picture());
}

PictureNames LoadedPhotograph::names() const {
  if (!photographs_->picture) return {listed_.picture.string(), listed_.mask ? listed_.mask->string() : ""};
  const std::string name = listed_.camera.file.empty() ? "the picture" : listed_.camera.file;
  return {name, "the mask of " + name};
}

FramedView LoadedPhotograph::framed(const Framing& framing) {
  return frame_view(listed_.camera, picture(), mask(), framing, names());
}

WholeView LoadedPhotograph::whole(int longest) {
  return whole_view(listed_.camera, picture(), mask(), longest, names());
}

bool LoadedPhotograph::is_masked() { return listed_.mask || (file_ ? info_.alpha : picture().channels == 4); }

}  // namespace vsplat
