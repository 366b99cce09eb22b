#include "model/data/survey.h"

#include <algorithm>
#include <cmath>

#include "model/data/framed_object.h"
#include "model/views/pose_check.h"

namespace vsplat {
namespace {

constexpr int looked_at_size = 64;

void widen(Extent& range, double value, bool first) {
  range.low = first ? value : std::min(range.low, value);
  range.high = first ? value : std::max(range.high, value);
}

double mean_alpha(const StoredView& view) {
  double sum = 0;
  for (std::size_t i = 3; i < view.rgba.size(); i += 4) sum += view.rgba[i];
  return sum / 255 / (static_cast<double>(view.rgba.size()) / 4);
}

}  // namespace

std::vector<int> spread(int count, int of) {
  count = std::min(count, of);
  std::vector<int> out;
  out.reserve(static_cast<std::size_t>(std::max(count, 0)));
  for (int i = 0; i < count; ++i) out.push_back(static_cast<int>(static_cast<long>(i) * of / count));
  return out;
}

ObjectSurvey survey(const DataObject& object, int pictures) {
  ObjectSurvey out;
  const FrameRequest request{looked_at_size, Crop::automatic, {}};
  const FramedObject framed = frame_object(object, request, &out.bad);
  out.views = framed.views();
  warn_of_inverted_masks(framed, pictures < 0 ? max_views : std::min(pictures, max_views));
  std::vector<Camera> cameras;
  cameras.reserve(static_cast<std::size_t>(out.views));
  for (const ListedView& view : framed.photographs.set.views) cameras.push_back(view.camera);
  warn_of_unlikely_cameras(framed.label, cameras);
  out.placement = framed.placement;
  for (int i = 0; i < out.views; ++i) {
    const Camera& c = framed.photographs.set.views[i].camera;
    widen(out.width, c.width, i == 0), widen(out.height, c.height, i == 0);
    widen(out.fov, 2 * std::atan(0.5 * c.width / c.fx) * 180 / M_PI, i == 0);
    widen(out.distance, (c.centre() - out.placement.centre).norm() / out.placement.edge, i == 0);
  }
  double sum = 0;
  for (const int view : spread(pictures < 0 ? out.views : pictures, out.views)) {
    try {
      sum += mean_alpha(store_view(framed, view, request));
      ++out.looked_at;
    } catch (const Error& e) {
      if (!is_about_data(e)) throw;
      out.bad.emplace_back(e.what());
    }
  }
  if (out.looked_at > 0) out.coverage = sum / out.looked_at;
  return out;
}

}  // namespace vsplat
