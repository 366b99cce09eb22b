// Render options of VS-Splat's network, with or without a densifier, for Network.
#pragma once
#include <array>

#include "model/networks/params/config.h"
#include "model/render/render.h"

namespace vsplat {

inline RenderOptions drawing_of(const Config& config) {
  RenderOptions out;
  if (config.negate_camera_centre) out.mirror = std::array<float, 3>{0, 0, 0};
  return out;
}

}  // namespace vsplat
