// A scene for the device: complete, or in chunks.
#pragma once
#include <functional>
#include <vector>

#include "model/base/gaussians.h"

namespace vsplat {

// Chunks begin at multiples of this many Gaussians.
constexpr long kChunkUnit = 1L << 16;

struct GaussianChunks {
  // The complete scene, on the device.
  GaussianChunks(const DeviceGaussians& gaussians);  // NOLINT(google-explicit-constructor): a scene in one chunk is one
  // Chunks of `chunk` Gaussians, a multiple of kChunkUnit; `get` returns the i-th chunk on the context's device.
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

// Prepares a host scene for pictures of up to `pixels` pixels: it stays on the device if that leaves enough memory for
// drawing, otherwise it is uploaded chunk by chunk whenever it is read. On a planning context, this only reserves
// memory.
GaussianChunks place_on_device(Context& ctx, const Gaussians& gaussians, double pixels);

}  // namespace vsplat
