#include "model/ops/fit/lpips.h"

#include <limits>

#include "runtime/fail.h"

namespace vsplat {
namespace {

int as_int(const char* op, long n) {
  if (n > std::numeric_limits<int>::max())
    fail(Status::memory, "{}: {} elements, at most 2147483647 are possible", op, n);
  return static_cast<int>(n);
}

}  // namespace

Tensor picture_map(Context& ctx, long height, long width, const Window2d& w) {
  const long rows = w.places(height), columns = w.places(width), taps = w.side * w.side;
  if (rows == 0 || columns == 0)
    fail(Status::internal, "picture_map: no place for a window of {} in {} x {}", w.side, width, height);
  Tensor map = ctx.tensor({rows * columns, taps}, Type::i32, "picture map");
  const int n = as_int("picture_map", map.count());
  ctx.launch({"lpips", "lpips_map", ""}, items(n), {0, 4.0 * n}, written(map), n, height, width, columns, w.side,
             w.stride, w.pad);
  return map;
}

void relu(Context& ctx, const Tensor& x) {
  if (!x || x.type() != Type::f32) fail(Status::internal, "relu: x is {}, f32 expected", x.describe());
  const int n = as_int("relu", x.count());
  if (n == 0) return;
  ctx.launch({"lpips", "lpips_relu", ""}, items(n), {0, 8.0 * n}, written(x), n);
}

Tensor max_pool(Context& ctx, const Tensor& picture, const Window2d& w) {
  if (!picture || picture.rank() != 3 || picture.type() != Type::f32)
    fail(Status::internal, "max_pool: the picture is {}, f32 [H, W, C] expected", picture.describe());
  const long height = picture.dim(0), width = picture.dim(1), channels = picture.dim(2);
  const long rows = w.places(height), columns = w.places(width);
  if (w.pad != 0 || rows == 0 || columns == 0)
    fail(Status::internal, "max_pool: no place for a window of {}, padded {}, in {} x {}", w.side, w.pad, width,
         height);
  as_int("max_pool", picture.count());
  Tensor out = ctx.tensor({rows, columns, channels}, Type::f32, "pooled");
  const int n = as_int("max_pool", out.count());
  if (n == 0) return out;
  ctx.launch({"lpips", "lpips_pool", ""}, items(n), {0, 4.0 * (static_cast<double>(picture.count()) + n)}, picture,
             written(out), n, width, channels, columns, w.side, w.stride);
  return out;
}

void feature_distance(Context& ctx, const FeatureDistance& d) {
  if (!d.a || d.a.rank() < 2 || d.a.type() != Type::f32 || d.b.shape() != d.a.shape() || d.b.type() != Type::f32)
    fail(Status::internal, "feature_distance: {} and {}, f32 [.., C] expected", d.a.describe(), d.b.describe());
  const long channels = d.a.shape().back(), places = channels == 0 ? 0 : d.a.count() / channels;
  if (d.weight.shape() != Shape{channels} || d.out.count() != places || d.out.type() != Type::f32)
    fail(Status::internal, "feature_distance: weight {} and out {} for {}", d.weight.describe(), d.out.describe(),
         d.a.describe());
  if (places == 0) return;
  const auto values = static_cast<double>(d.a.count());
  ctx.launch({"lpips", "lpips_distance", ""}, items(places), {10 * values, 16 * values}, d.a, d.b, d.weight,
             written(d.out), as_int("feature_distance", places), channels);
}

}  // namespace vsplat
