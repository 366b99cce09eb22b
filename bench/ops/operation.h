// What the benchmark of a single operation is made of: bench/ops/NAME.cpp times what model/ops/NAME.h declares, at the
// paper's size unless its name says otherwise. Before that the operation's case of the self-test compares it with a
// reference on the host; what was computed at this size has to be numbers, and not zeros throughout; some say what
// single results are to be (Prepared::error).
// It costs what its launches say.
#pragma once
#include <functional>
#include <vector>

#include "bench/bench.h"
#include "bench/case_data.h"
#include "model/base/camera.h"
#include "model/base/device_cameras.h"
#include "model/base/gaussians.h"

namespace vsplat::bench {

// Four views of 512 pixels, tokens of 16 x 16; a volume of 48^3 voxels, a tenth of which are selected, with 16
// Gaussians each (and the skeleton's); degree 1, so that a Gaussian's raw numbers are 23.
inline constexpr long kViews = 4, kImage = 512, kPatch = 16, kTokens = 32, kDim = 768;
inline constexpr long kSide = 48, kVoxels = kSide * kSide * kSide, kSelected = 11059, kFine = 16, kRaw = 23, kSh = 4;

// run() enqueues the operation once; `outputs` hold something after it.
Prepared operation(Context& ctx, std::function<void()> run, std::vector<Tensor> outputs);
// Where the operation makes its outputs.
Prepared operation_with(Context& ctx, std::function<void()> run, std::function<std::vector<Tensor>()> outputs);

Tensor random(Context& ctx, const Shape& shape, std::uint32_t seed, float low = -1.0f, float high = 1.0f);
DeviceGaussians random_gaussians(Context& ctx, long count, std::uint32_t seed);
GaussianGradients random_gradients(Context& ctx, long count, std::uint32_t seed);
// i32 [kSelected]: the selected voxels, near a sphere, ascending.
Tensor selected_voxels(Context& ctx);
// f32 [kSelected, 3]: their centres.
Tensor selected_centres(Context& ctx);
// u32 [kVoxels]: 1 where a voxel is selected.
Tensor selected_flags(Context& ctx);
// kViews of them, about the object.
std::vector<Camera> orbit_cameras();
DeviceCameras cameras(Context& ctx);

}  // namespace vsplat::bench
