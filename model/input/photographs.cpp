#include "model/input/photographs.h"

namespace vsplat {

ListedView resolved_view(const Photographs& photographs, int index) {
  ListedView view = photographs.set.views[index];
  if (photographs.picture) {
    if (is_resolved(view)) return view;  // its picture's size is looked at where it is made
    const Image picture = photographs.picture(index);
    resolve_intrinsics(view, picture.width, picture.height);
    return view;
  }
  const ImageInfo info = read_image_info(view.picture.string());
  resolve_intrinsics(view, info.width, info.height);
  return view;
}

LoadedPhotograph::LoadedPhotograph(const Photographs& photographs, int view)
    : photographs_(&photographs), view_(view), listed_(photographs.set.views[view]) {
  if (!photographs.picture) {
    file_.emplace(listed_.picture.string());
    info_ = file_->info();
    resolve_intrinsics(listed_, info_.width, info_.height);
  } else if (!is_resolved(listed_)) {
    resolve_intrinsics(listed_, picture().width, picture().height);
  }
}

const Image& LoadedPhotograph::picture() {
  if (!picture_) {
    picture_ = file_ ? file_->decode() : photographs_->picture(view_);
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
