#include "model/data/framed_object.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "model/base/resample.h"
#include "model/views/mask_check.h"
#include "model/views/pose_check.h"
#include "model/views/view_choice.h"
#include "runtime/fail.h"
#include "runtime/log.h"
#include "runtime/printable.h"

namespace vsplat {

FramedObject frame_object(const DataObject& object, const FrameRequest& request, std::vector<std::string>* skipped) {
  FramedObject out{
      object.name, open_object(object, skipped, request.missing, request.to_train_on), {}, label_of(object)};
  try {
    std::vector<int> all(static_cast<std::size_t>(out.views()));
    std::iota(all.begin(), all.end(), 0);
    const ChosenPlacement place =
        find_placement(out.photographs, spread_views(out.photographs.set, all, max_views), request.placement);
    out.placement = place.placement;
    verbose("{}: {}", object.name, place.found);
    std::vector<Camera> cameras;
    cameras.reserve(all.size());
    for (const ListedView& view : out.photographs.set.views) cameras.push_back(view.camera);
    check_centre_is_seen(cameras, out.photographs.set.convention, place);
  } catch (const Error& e) {
    fail(e.status(), "{}: {}", out.label, e.what());
  }
  return out;
}

void warn_of_inverted_masks(const FramedObject& object, int count) {
  std::vector<int> all(static_cast<std::size_t>(object.views()));
  std::iota(all.begin(), all.end(), 0);
  std::vector<MaskShares> masks;
  for (const int view : spread_views(object.photographs.set, all, count)) {
    try {
      if (const auto shares = LoadedPhotograph(object.photographs, view).shares()) masks.push_back(*shares);
    } catch (const Error& e) {
      if (!is_about_data(e)) throw;
    }
  }
  warn_of_inverted_masks(object.label, masks);
}

StoredView store_view(const FramedObject& object, int view, const FrameRequest& request) {
  const auto complain = [&](Status status, const std::string& what) {
    fail(status, "{}: view {} ({}): {}", object.label, view,
         printable(object.photographs.set.views.at(static_cast<std::size_t>(view)).name), what);
  };
  FramedView framed;
  StoredView out;
  try {
    LoadedPhotograph photograph(object.photographs, view);
    framed = photograph.framed({request.image, request.crop, object.placement.centre, object.placement.edge});
    out.masked = photograph.is_masked();
  } catch (const Error& e) {
    complain(e.status(), e.what());
  }
  out.camera = std::move(framed.camera);
  out.rgba.resize(framed.image.data.size());
  std::uint8_t most = 0, least = 255;
  for (std::size_t i = 0; i < out.rgba.size(); i += 4) {
    const float* p = &framed.image.data[i];
    for (int c = 0; c < 3; ++c) out.rgba[i + c] = p[3] > 0 ? byte_of(p[c] / p[3]) : 0;
    out.rgba[i + 3] = byte_of(p[3]);
    most = std::max(most, out.rgba[i + 3]), least = std::min(least, out.rgba[i + 3]);
  }
  if (most == 0)
    complain(Status::input, "its alpha (or mask) is 0 everywhere: nothing of the object is in the network's picture");
  out.opaque = least == 255;
  return out;
}

void composite(const StoredView& view, const std::array<float, 3>& background, std::vector<float>& out) {
  Image picture(view.camera.width, view.camera.height, 4);
  for (std::size_t i = 0; i < view.rgba.size(); ++i) picture.data[i] = static_cast<float>(view.rgba[i]) / 255.0f;
  const Image flat = over(premultiplied(picture), background);
  out.insert(out.end(), flat.data.begin(), flat.data.end());
}

}  // namespace vsplat
