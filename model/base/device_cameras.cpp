#include "model/base/device_cameras.h"

namespace vsplat {

DeviceCameras upload_cameras(Context& ctx, const std::vector<Camera>& cameras) {
  std::vector<float> c2w, w2c, intrinsics;
  for (const Camera& camera : cameras) {
    const Eigen::Matrix4d inverse = camera.c2w();
    for (int i = 0; i < 16; ++i) {
      c2w.push_back(static_cast<float>(inverse(i / 4, i % 4)));
      w2c.push_back(static_cast<float>(camera.w2c(i / 4, i % 4)));
    }
    for (const double v : {camera.fx, camera.fy, camera.cx, camera.cy}) intrinsics.push_back(static_cast<float>(v));
  }
  const long views = static_cast<long>(cameras.size());
  return {ctx.upload({views, 4, 4}, c2w, Type::f32, "c2w"), ctx.upload({views, 4, 4}, w2c, Type::f32, "w2c"),
          ctx.upload({views, 4}, intrinsics, Type::f32, "intrinsics")};
}

}  // namespace vsplat
