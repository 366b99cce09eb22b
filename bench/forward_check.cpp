#include "bench/layer_check.h"
#include "runtime/fail.h"

namespace vsplat::bench {

double ModelCheck::run(const VsplatModel& model, std::string* worst) {
  ForwardOptions options;
  options.selection = &in_.selection;
  options.tap = [&](const std::string& name, const Tensor& t) { taps_[name] = read(t); };
  model.forward(ctx_, in_.images, in_.views, options);
  check_features();
  check_volume();
  check_coarse();
  check_refined();
  check_final();
  if (worst) *worst = where_;
  return worst_;
}

Floats ModelCheck::read(const Tensor& t) const { return ctx_.read<float>(t); }

Tensor ModelCheck::upload(const std::string& name, const Shape& shape) const { return ctx_.upload(shape, tap(name)); }

void ModelCheck::note(const std::string& what, double error) {
  if (error <= worst_ || !std::isfinite(worst_)) return;
  worst_ = error, where_ = what;
}

void ModelCheck::same(const std::string& what, const Floats& got, const Floats& want) {
  double largest = 0, off = got.size() == want.size() ? 0 : INFINITY;
  for (std::size_t i = 0; i < std::min(got.size(), want.size()); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(want[i])));
    const double by = std::abs(static_cast<double>(got[i]) - static_cast<double>(want[i]));
    off = std::isfinite(by) ? std::max(off, by) : INFINITY;
    if (!std::isfinite(by)) break;
  }
  note(what, largest > 0 ? off / largest : INFINITY);
}

Eigen::Vector3d ModelCheck::centre_of(long voxel) const {
  const long r = config_.volume, x = voxel / (r * r), y = voxel / r % r, z = voxel % r;
  return (Eigen::Vector3d(static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)).array() + 0.5) /
             static_cast<double>(r) -
         0.5;
}

ref::Rows ModelCheck::rows_of_source(const RowSource& source) const {
  ref::Rows out;
  out.x0 = read(source.x0), out.c0 = source.x0.shape().back(), out.rows = source.x0.rows();
  if (source.x1) out.x1 = read(source.x1), out.c1 = source.x1.shape().back();
  out.scale = read(source.scale), out.shift = read(source.shift);
  out.silu = source.silu;
  return out;
}

ref::Rows ModelCheck::checked_norm(const Layers& layers, const std::string& name, const RowSource& source) {
  ref::Rows rows = rows_of_source(source);
  const long channels = rows.c0 + rows.c1, size = channels / config_.groups;
  std::vector<double> sums(u(channels)), squares(u(channels));
  for (long row = 0; row < rows.rows; ++row)
    for (long c = 0; c < channels; ++c) {
      const double v = c < rows.c0 ? rows.x0[u(row * rows.c0 + c)] : rows.x1[u(row * rows.c1 + c - rows.c0)];
      sums[u(c)] += v, squares[u(c)] += v * v;
    }
  Floats got = rows.scale;
  got.insert(got.end(), rows.shift.begin(), rows.shift.end());
  const std::string norm = layers.has(name + ".weight") ? name : name + ".group_norm";
  const Floats &gamma = layers.at(norm + ".weight"), &beta = layers.at(norm + ".bias");
  sampled(layers.prefix + name, got, [&](long i) {
    const long c = i % channels, first = c / size * size;
    const auto count = static_cast<double>(size * rows.rows);
    double mean = 0, square = 0;
    for (long k = first; k < first + size; ++k) mean += sums[u(k)] / count, square += squares[u(k)] / count;
    const double scale = static_cast<double>(gamma[u(c)]) / std::sqrt(square - mean * mean + kNormEps);
    return i < channels ? scale : static_cast<double>(beta[u(c)]) - mean * scale;
  });
  return rows;
}

double model_error(Context& ctx, const ModelInput& in, const VsplatModel& model, std::string* worst) {
  if (in.config.encoder_sizes().dinov3 || in.config.predicts_poses() || in.config.levels != "fine")
    fail(Status::internal, "bench: of networks with DINO's encoder, known poses and both levels a forward is checked");
  return ModelCheck(ctx, in).run(model, worst);
}

}  // namespace vsplat::bench
