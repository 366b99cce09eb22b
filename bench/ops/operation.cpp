#include "bench/ops/operation.h"

#include <cmath>
#include <utility>

#include "bench/scenes.h"
#include "model/views/orbit.h"
#include "runtime/fail.h"

namespace vsplat::bench {
namespace {

std::vector<int> selected() { return shell(static_cast<int>(kSide), static_cast<std::size_t>(kSelected)); }

// Whether there is something, and nothing that is no number.
bool holds_numbers(Context& ctx, const Tensor& tensor) {
  if (tensor.type() != Type::f32) {
    const Tensor bytes(tensor.block(), {static_cast<long>(tensor.bytes())}, Type::u8);
    for (const auto v : ctx.read<std::uint8_t>(bytes))
      if (v != 0) return true;
    return false;
  }
  bool any = false;
  for (const float v : ctx.read<float>(tensor)) {
    if (!std::isfinite(v)) return false;
    any = any || v != 0;
  }
  return any;
}

}  // namespace

Prepared operation(Context& ctx, std::function<void()> run, std::vector<Tensor> outputs) {
  return operation_with(ctx, std::move(run), [outputs = std::move(outputs)] { return outputs; });
}

Prepared operation_with(Context& ctx, std::function<void()> run, std::function<std::vector<Tensor>()> outputs) {
  Prepared p;
  p.kind = Kind::operation;
  p.run = std::move(run);
  p.look = [&ctx, outputs = std::move(outputs)] {
    for (const Tensor& tensor : outputs())
      if (!holds_numbers(ctx, tensor)) return false;
    return true;
  };
  return p;
}

Tensor random(Context& ctx, const Shape& shape, std::uint32_t seed, float low, float high) {
  long count = 1;
  for (const long n : shape) count *= n;
  return ctx.upload(shape, random_floats(count, seed, low, high));
}

DeviceGaussians random_gaussians(Context& ctx, long count, std::uint32_t seed) {
  return {random(ctx, {count, 3}, seed, -0.5f, 0.5f), random(ctx, {count, 3}, seed + 1, 0.002f, 0.02f),
          random(ctx, {count, 4}, seed + 2), random(ctx, {count}, seed + 3, 0.1f, 0.9f),
          random(ctx, {count, kSh, 3}, seed + 4)};
}

GaussianGradients random_gradients(Context& ctx, long count, std::uint32_t seed) {
  return {random(ctx, {count, 3}, seed), random(ctx, {count, 3}, seed + 1), random(ctx, {count, 4}, seed + 2),
          random(ctx, {count}, seed + 3), random(ctx, {count, kSh, 3}, seed + 4)};
}

Tensor selected_voxels(Context& ctx) { return ctx.upload({kSelected}, selected(), Type::i32); }

Tensor selected_centres(Context& ctx) {
  std::vector<float> centres;
  for (const int i : selected())
    for (const long at : {i / (kSide * kSide), i / kSide % kSide, i % kSide})
      centres.push_back((static_cast<float>(at) + 0.5f) / static_cast<float>(kSide) - 0.5f);
  return ctx.upload({kSelected, 3}, centres);
}

Tensor selected_flags(Context& ctx) {
  std::vector<std::uint32_t> flags(static_cast<std::size_t>(kVoxels));
  for (const int i : selected()) flags[static_cast<std::size_t>(i)] = 1;
  return ctx.upload({kVoxels}, flags, Type::u32);
}

std::vector<Camera> orbit_cameras() {
  const auto edge = static_cast<int>(kImage);
  return orbit_about(make_scene("small-5k").cameras, Eigen::Vector3d::Zero(), static_cast<int>(kViews), edge, edge);
}

DeviceCameras cameras(Context& ctx) { return upload_cameras(ctx, orbit_cameras()); }

}  // namespace vsplat::bench
