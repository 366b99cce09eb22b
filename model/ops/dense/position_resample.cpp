#include "model/ops/dense/position_resample.h"

#include <algorithm>
#include <cmath>

#include "runtime/fail.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

double keys(double x) {
  constexpr double a = -0.5;
  x = std::abs(x);
  if (x < 1) return ((a + 2) * x - (a + 3)) * x * x + 1;
  if (x < 2) return (((x - 5) * x + 8) * x - 4) * a;
  return 0;
}

}  // namespace

ResampleAxis bicubic_axis(int from, int to) {
  ResampleAxis axis;
  if (from == to) {
    axis.taps = 1;
    axis.weight.assign(static_cast<std::size_t>(to), 1.0f);
    for (int i = 0; i < to; ++i) axis.first.push_back(i);
    return axis;
  }
  const double scale = static_cast<double>(from) / to, widen = std::max(scale, 1.0), support = 2 * widen;
  std::vector<std::vector<double>> weights;
  for (int i = 0; i < to; ++i) {
    const double centre = scale * (i + 0.5);
    const int first = std::max(static_cast<int>(std::lround(centre - support)), 0);
    const int end = std::min(static_cast<int>(std::lround(centre + support)), from);
    std::vector<double> row;
    double sum = 0;
    for (int j = first; j < end; ++j) {
      row.push_back(keys((j - centre + 0.5) / widen));
      sum += row.back();
    }
    for (double& w : row) w /= sum;  // also at the borders, where a part of the kernel is cut off
    axis.first.push_back(first);
    axis.taps = std::max(axis.taps, static_cast<int>(row.size()));
    weights.push_back(std::move(row));
  }
  for (std::vector<double>& row : weights) {
    row.resize(static_cast<std::size_t>(axis.taps), 0.0);
    for (const double w : row) axis.weight.push_back(static_cast<float>(w));
  }
  return axis;
}

ResampleAxis transposed(const ResampleAxis& axis, int from) {
  const int to = static_cast<int>(axis.first.size());
  const auto weight = [&](int i, int j) {  // the weight of stored position j in output i
    const auto row = static_cast<std::size_t>(i), taps = static_cast<std::size_t>(axis.taps);
    const int tap = j - axis.first[row];
    return tap < 0 || tap >= axis.taps ? 0.0f : axis.weight[row * taps + static_cast<std::size_t>(tap)];
  };
  // The outputs that use a stored position are consecutive: one run, from the first to the last.
  ResampleAxis out;
  std::vector<std::vector<float>> runs;
  for (int j = 0; j < from; ++j) {
    int first = 0, end = 0;
    for (int i = 0; i < to; ++i)
      if (weight(i, j) != 0) {
        if (end == 0) first = i;
        end = i + 1;
      }
    std::vector<float> run;
    for (int i = first; i < end; ++i) run.push_back(weight(i, j));
    out.first.push_back(first);
    out.taps = std::max(out.taps, end - first);
    runs.push_back(std::move(run));
  }
  for (std::vector<float>& run : runs) {
    run.resize(static_cast<std::size_t>(out.taps), 0.0f);
    out.weight.insert(out.weight.end(), run.begin(), run.end());
  }
  return out;
}

void position_resample_forward(Context& ctx, const PositionResampleForward& a) {
  const long g = a.from, t = a.to;
  if (g < 1 || t < 1) fail(Status::internal, "position_resample: from {} to {} tokens", g, t);
  Dims d;
  d.set("stored tokens", 1 + g * g).set("tokens", 1 + t * t).bind("stored", a.stored, {"stored tokens", "C"});
  d.bind("class_token", a.class_token, {"C"}).bind("out", a.out, {"tokens", "C"});
  const long c = d["C"];
  const ResampleAxis axis = bicubic_axis(a.from, a.to);
  const Tensor first = ctx.upload({t}, axis.first, Type::i32, "position_resample.first");
  const Tensor weight = ctx.upload({t, axis.taps}, axis.weight, Type::f32, "position_resample.weight");
  const double taps = static_cast<double>(axis.taps) * axis.taps;
  ctx.launch({"position_resample", "position_resample_forward", ""}, groups((c + 63) / 64, 64, 1 + t * t),
             {2.0 * taps * static_cast<double>(a.out.count()), static_cast<double>(a.out.bytes() + a.stored.bytes())},
             a.stored, a.class_token, first, weight, written(a.out), a.from, a.to, axis.taps, c);
}

void position_resample_backward(Context& ctx, const PositionResampleBackward& a) {
  const long g = a.from, t = a.to;
  if (g < 1 || t < 1) fail(Status::internal, "position_resample: from {} to {} tokens", g, t);
  Dims d;
  d.set("stored tokens", 1 + g * g).set("tokens", 1 + t * t).bind("dout", a.dout, {"tokens", "C"});
  d.bind("dstored", a.dstored, {"stored tokens", "C"}).bind("dclass_token", a.dclass_token, {"C"});
  const long c = d["C"];
  const ResampleAxis axis = transposed(bicubic_axis(a.from, a.to), a.from);
  const Tensor first = ctx.upload({g}, axis.first, Type::i32, "position_resample.first");
  const Tensor weight = ctx.upload({g, axis.taps}, axis.weight, Type::f32, "position_resample.weight");
  const double taps = static_cast<double>(axis.taps) * axis.taps;
  ctx.launch({"position_resample", "position_resample_backward", ""}, groups((c + 63) / 64, 64, 1 + g * g),
             {2.0 * taps * static_cast<double>(a.dstored.count()),
              static_cast<double>(a.dout.bytes() + 2 * a.dstored.bytes())},
             a.dout, first, weight, written(a.dstored), written(a.dclass_token), a.from, a.to, axis.taps, c);
}

}  // namespace vsplat
