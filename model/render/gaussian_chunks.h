// A scene as a device takes it: whole, or chunk by chunk.
#pragma once
#include <functional>
#include <vector>

#include "model/base/gaussians.h"

namespace vsplat {

// Chunks begin at multiples of this many Gaussians.
constexpr long kChunkUnit = 1L << 16;

struct GaussianChunks {
  // All of it, on the device.
  GaussianChunks(const DeviceGaussians& gaussians);  // NOLINT(google-explicit-constructor): a scene in one chunk is one
  // `chunk` Gaussians each, a multiple of kChunkUnit; `get` has the i-th on the context's device.
  GaussianChunks(long count, int sh_degree, long chunk, std::function<DeviceGaussians(Context&, long)> get,
                 GaussianKind kind = GaussianKind::volume);

  long chunks() const { return (count + chunk - 1) / chunk; }
  long size_of(long i) const { return i + 1 < chunks() ? chunk : count - i * chunk; }

  long count = 0;
  int sh_degree = 0;
  long chunk = 1;
  std::function<DeviceGaussians(Context&, long)> get;
  GaussianKind kind = GaussianKind::volume;
};

// A host's scene for pictures of up to that many pixels: on the device for good, if that leaves enough memory to draw
// with, else uploaded chunk by chunk whenever it is read. On a context that plans, only room is taken.
GaussianChunks place_on_device(Context& ctx, const Gaussians& gaussians, double pixels);

}  // namespace vsplat
