#include "model/train/training_sheet.h"

#include <algorithm>
#include <cmath>

#include "model/base/scene.h"
#include "model/io/picture/contact_sheet.h"
#include "model/render/render.h"

namespace vsplat {
namespace {

// Spheres at the centres of the voxels; red, green and blue encode x, y and z.
Gaussians balls(const std::vector<int>& voxels, int volume) {
  Gaussians out;
  out.count = voxels.size();
  const float cell = 1.0f / static_cast<float>(volume);
  for (const int v : voxels) {
    const int at[3] = {v / (volume * volume), v / volume % volume, v % volume};
    for (const int i : at) {
      const float place = (static_cast<float>(i) + 0.5f) * cell;
      out.means.push_back(place - 0.5f);
      out.scales.push_back(0.3f * cell);
      out.sh.push_back((place - 0.5f) / static_cast<float>(kShC0));
    }
    out.quats.insert(out.quats.end(), {1, 0, 0, 0});
    out.opacities.push_back(0.95f);
  }
  return out;
}

Image clamped(Image picture) {
  for (float& v : picture.data) v = std::isfinite(v) ? std::clamp(v, 0.0f, 1.0f) : 0.0f;
  return picture;
}

}  // namespace

Image training_sheet(Context& ctx, const Network& network, const TrainingViews& views, double temperature,
                     long planned_selected) {
  const long s = network.config().image(), n = views.inputs;
  ForwardOptions forward;
  forward.temperature = temperature;
  forward.planned_selected = planned_selected;
  const std::vector<Camera> inputs(views.cameras.begin(), views.cameras.begin() + n);
  const Network::Result result = network.forward(ctx, ctx.upload({n, s, s, 3}, views.pictures.data()), inputs, forward);
  const DeviceGaussians voxels = upload(ctx, balls(result.voxels, result.volume));

  SheetOptions options;
  options.columns = 4;
  ContactSheet sheet(options);
  for (std::size_t v = 0; v < views.cameras.size(); ++v) {
    Image truth(static_cast<int>(s), static_cast<int>(s), 3);
    std::copy_n(views.pictures.begin() + static_cast<std::ptrdiff_t>(v * truth.data.size()), truth.data.size(),
                truth.data.begin());
    RenderOptions how = network.drawing();
    how.near = static_cast<float>(kNearInObject);
    if (static_cast<long>(v) >= n) how.background = views.background;
    sheet.add(truth);
    for (const DeviceGaussians* level : {&result.coarse, &result.final, &voxels})
      sheet.add(clamped(render_picture(ctx, *level, views.cameras[v], how).colour));
  }
  return sheet.sheet();
}

}  // namespace vsplat
