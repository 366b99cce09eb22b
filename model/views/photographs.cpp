#include "model/views/photographs.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "model/base/resample.h"
#include "model/io/views/view_checks.h"
#include "runtime/fail.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

// The picture's size after applying its orientation.
std::pair<int, int> turned_size(const ImageInfo& info, int turning) {
  return turning >= 5 ? std::pair{info.height, info.width} : std::pair{info.width, info.height};
}

bool is_kept(const ImageInfo& info) {
  constexpr long most_kept = 1L << 24;  // pixels; 256 MiB
  return static_cast<long>(info.width) * info.height <= most_kept;
}

// A mask that owns its picture's rows, scaled to the given size.
class OwnedMask : public PixelRows {
 public:
  OwnedMask(std::unique_ptr<PixelRows> picture, int w, int h, bool invert)
      : PixelRows(w, h, 1), picture_(std::move(picture)), mask_(*picture_), invert_(invert) {
    if (mask_.width != w || mask_.height != h) resized_.emplace(mask_, w, h);
  }
  void next(float* row) override {
    resized_ ? resized_->next(row) : mask_.next(row);
    for (float* v = row; invert_ && v < row + width; ++v) *v = 1 - *v;
  }

 private:
  std::unique_ptr<PixelRows> picture_;
  MaskRows mask_;
  std::optional<ResizedRows> resized_;
  bool invert_;
};

}  // namespace

int turning_of(const ViewSet& set, const ListedView& view, const ImageInfo& info) {
  std::error_code error;
  if (info.orientation == 1 || std::filesystem::is_directory(set.source, error)) return 1;  // a folder: COLMAP
  const Camera& c = view.camera;
  const bool turned = info.orientation >= 5 && c.width > 0 && c.height > 0 && c.width != c.height;
  if (turned && (c.width > c.height) == (info.width > info.height)) return 1;
  if (turned) return info.orientation;
  fail(Status::input,
       "{}: the picture has EXIF orientation {}, and {} does not say whether its pose is for the turned picture or for "
       "the stored one: store it turned (`mogrify -auto-orient`), or remove the tag (`exiftool -Orientation=`)",
       view.picture.string(), info.orientation, set.source.string());
}

ListedView resolved_view(const Photographs& photographs, int index) {
  ListedView view = photographs.set.views[index];
  if (photographs.picture) {
    if (is_resolved(view)) return view;  // the picture's size is read when it is made
    const Image picture = photographs.picture(index);
    resolve_intrinsics(view, picture.width, picture.height);
    return view;
  }
  const ImageInfo info = read_image_info(view.picture.string());
  const auto [width, height] = turned_size(info, turning_of(photographs.set, view, info));
  resolve_intrinsics(view, width, height);
  return view;
}

double host_bytes_to_load(const Photographs& photographs) {
  double sum = 0, most = 0;
  const auto count = [&](const std::string& path) {
    const ImageInfo info = read_image_info(path);
    sum += static_cast<double>(std::filesystem::file_size(path));
    if (is_kept(info)) sum += static_cast<double>(info.width) * info.height * (info.alpha ? 4 : 3) * sizeof(float);
    most = std::max(most, info.held);
  };
  for (const ListedView& view : photographs.set.views) {
    if (photographs.picture) continue;
    count(view.picture.string());
    if (view.mask) count(view.mask->string());
  }
  return sum + most;
}

PhotographFile::PhotographFile(const std::string& path) : file_(path), info_(file_->info()) {}

std::unique_ptr<PixelRows> PhotographFile::rows(int turning, bool once) {
  if (file_ && (once || !is_kept(info_))) return file_->rows(turning);
  if (file_) decoded_ = file_->decode(turning);
  file_.reset();
  return std::make_unique<ImageRows>(*decoded_);
}

LoadedPhotograph::LoadedPhotograph(const Photographs& photographs, int view)
    : photographs_(&photographs), view_(view), listed_(photographs.set.views[view]) {
  if (!photographs.picture) {
    file_.emplace(listed_.picture.string());
    turning_ = turning_of(photographs.set, listed_, file_->info());
    const auto [width, height] = turned_size(file_->info(), turning_);
    resolve_intrinsics(listed_, width, height);
  } else if (!is_resolved(listed_)) {
    resolve_intrinsics(listed_, made_picture().width, made_picture().height);
  }
}

const Image& LoadedPhotograph::made_picture() {
  if (!made_) made_ = photographs_->picture(view_);
  return *made_;
}

std::unique_ptr<PixelRows> LoadedPhotograph::picture(bool once) {
  if (file_) return file_->rows(turning_, once);
  return std::make_unique<ImageRows>(made_picture());
}

std::unique_ptr<PixelRows> LoadedPhotograph::mask(bool once) {
  if (!listed_.mask) return nullptr;
  if (!mask_file_) mask_file_.emplace(listed_.mask->string());
  const int width = listed_.camera.width, height = listed_.camera.height;
  const ImageInfo& info = mask_file_->info();
  if (!is_same_shape(info.width, info.height, width, height))
    fail(Status::input, "{} is {} x {} pixels, its picture {} is {} x {}: a mask must have its picture's shape",
         names().mask, info.width, info.height, names().picture, width, height);
  return std::make_unique<OwnedMask>(mask_file_->rows(1, once), width, height, photographs_->invert_masks);
}

std::unique_ptr<PixelRows> LoadedPhotograph::object_mask() { return has_object_mask() ? mask() : nullptr; }

std::optional<MaskExtent> LoadedPhotograph::extent() {
  if (has_object_mask()) return mask_extent(*mask());
  if (is_masked()) return mask_extent(*picture());
  return std::nullopt;
}

PictureNames LoadedPhotograph::names() const {
  if (!photographs_->picture) return {listed_.picture.string(), listed_.mask ? listed_.mask->string() : ""};
  const std::string name = listed_.camera.file.empty() ? "the picture" : listed_.camera.file;
  return {name, "the mask of " + name};
}

std::optional<MaskShares> LoadedPhotograph::shares() {
  if (!is_masked()) return std::nullopt;
  if (has_object_mask()) return mask_shares(*mask());
  return mask_shares(*picture());
}

FramedView LoadedPhotograph::framed(const Framing& framing) {
  const std::unique_ptr<PixelRows> pixels = picture(), masks = object_mask();
  return frame_view(listed_.camera, *pixels, masks.get(), framing, names());
}

WholeView LoadedPhotograph::whole(int longest) {
  const std::unique_ptr<PixelRows> pixels = picture(true), masks = mask(true);
  const bool object = has_object_mask();
  return whole_view(listed_.camera, *pixels, object ? masks.get() : nullptr, longest, names(),
                    object ? nullptr : masks.get());
}

std::vector<float> LoadedPhotograph::depths(const WholeView& whole) const {
  return photographs_->depths ? photographs_->depths(view_, listed_.camera, whole.camera) : std::vector<float>();
}

void check_masks_of(const Photographs& photographs, std::span<const int> views) {
  std::vector<MaskShares> masks;
  for (const int view : views)
    if (const std::optional<MaskShares> shares = LoadedPhotograph(photographs, view).shares()) masks.push_back(*shares);
  check_masks(photographs.set.source.string(), masks, views.size());
}

void leave_out_unreadable(Photographs& photographs) {
  std::size_t tried = 0, bad = 0;
  const ListedView* first = nullptr;
  for (std::size_t i = 0; i < photographs.set.views.size(); ++i) {
    ListedView& view = photographs.set.views[i];
    if (view.picture.empty()) continue;
    ++tried;
    noting_problems(view, [&] { LoadedPhotograph(photographs, static_cast<int>(i)).read_through(); });
    if (view.problem.empty()) continue;
    ++bad;
    if (!first) first = &view;
  }
  if (!first) return;
  if (bad == tried) need_good(*first);
  warn("{}: {} of {} pictures cannot be read or used and are left out; the first: {}", photographs.set.source.string(),
       bad, tried, first->problem);
}

void LoadedPhotograph::read_through() {
  const std::unique_ptr<PixelRows> pixels = picture(), masks = mask();
  for (PixelRows* rows : {pixels.get(), masks.get()}) {
    if (!rows) continue;
    std::vector<float> row(rows->row_size());
    for (int y = 0; y < rows->height; ++y) rows->next(row.data());
  }
}

bool LoadedPhotograph::is_masked() {
  return has_object_mask() || (file_ ? file_->info().alpha : made_picture().channels == 4);
}

}  // namespace vsplat
