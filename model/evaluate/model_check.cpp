#include "model/evaluate/model_check.h"

#include <algorithm>

#include "model/base/scene.h"
#include "model/data/endless_objects.h"
#include "model/evaluate/evaluation_views.h"
#include "model/metrics/metrics.h"
#include "model/render/render.h"

namespace vsplat {
namespace {

constexpr std::array<float, 3> kPaper{1, 1, 1};
// The object, and the number of cameras to choose from, typical for a data set.
constexpr std::uint64_t kSeed = 20;
constexpr std::uint32_t kObject = 0;
constexpr int kCameras = 40;

Image clamped(Image picture) {
  for (float& v : picture.data) v = std::clamp(v, 0.0f, 1.0f);
  return picture;
}

// Input views, on white.
struct Inputs {
  std::vector<int> views;  // of the object
  std::vector<Image> pictures;
  std::vector<Camera> cameras;       // in the object's frame
  std::vector<std::size_t> nearest;  // for each the index of the nearest other one by angle
};

Inputs inputs_of(const FramedObject& object, const TakenViews& taken) {
  std::vector<Eigen::Vector3d> positions;
  for (const ListedView& view : object.photographs.set.views) positions.push_back(view.camera.centre());
  Inputs out;
  out.views = evaluation_views(positions, std::max(2, taken.trained), Protocol::kmeans, 0, object.name).inputs;
  FrameRequest frame;
  frame.image = taken.image;
  for (const int view : out.views) {
    const StoredView stored = store_view(object, view, frame);
    Image picture;
    picture.width = picture.height = taken.image;
    picture.channels = 3;
    composite(stored, kPaper, picture.data);
    out.pictures.push_back(std::move(picture));
    out.cameras.push_back(stored.camera);
    std::vector<int> others = out.views;
    std::erase(others, view);
    const int nearest =
        nearest_view(positions, others, positions[static_cast<std::size_t>(view)], object.placement.centre);
    out.nearest.push_back(
        static_cast<std::size_t>(std::find(out.views.begin(), out.views.end(), nearest) - out.views.begin()));
  }
  out.cameras = place_views(out.cameras, object.placement, taken.rebase).cameras;
  return out;
}

}  // namespace

ModelCheck check_model(Context& ctx, const Network& network, const ForwardOptions& options) {
  const TakenViews taken = network.config().taken();
  const FramedObject object = endless_object(kSeed, kObject, kCameras, taken.image, nullptr);
  const Inputs inputs = inputs_of(object, taken);
  std::vector<float> pictures;
  for (const Image& picture : inputs.pictures)
    pictures.insert(pictures.end(), picture.data.begin(), picture.data.end());
  const auto views = static_cast<long>(inputs.views.size());
  const Tensor input = ctx.upload({views, taken.image, taken.image, 3}, pictures, Type::f32, "pictures");
  const Network::Result result = network.forward(ctx, input, inputs.cameras, options);
  const DeviceGaussians& gaussians = network.config().has_fine() ? result.final : result.coarse;
  RenderOptions drawing = network.drawing();
  drawing.background = kPaper;
  drawing.near = static_cast<float>(kNearInObject);

  ModelCheck out;
  out.object = object.name;
  out.gaussians = gaussians.count();
  for (std::size_t i = 0; i < inputs.views.size(); ++i) {
    const Image& truth = inputs.pictures[i];
    const Image drawn = clamped(render_picture(ctx, gaussians, inputs.cameras[i], drawing).colour);
    CheckedView view;
    view.name = object.photographs.set.views[static_cast<std::size_t>(inputs.views[i])].name;
    view.psnr = psnr(drawn, truth);
    view.psnr_nearest = psnr(inputs.pictures[inputs.nearest[i]], truth);
    out.psnr += view.psnr / static_cast<double>(views);
    out.psnr_nearest += view.psnr_nearest / static_cast<double>(views);
    out.views.push_back(std::move(view));
  }
  return out;
}

}  // namespace vsplat
