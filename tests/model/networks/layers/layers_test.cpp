// The backward functions of layers, against differences of sums in double.
#include "model/networks/layers/layers.h"

#include <gtest/gtest.h>

#include <functional>

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/gemm.h"
#include "model/networks/layers/upload_weights.h"
#include "model/networks/params/init.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using Matrix = std::vector<double>;
using test::random_floats;

std::size_t u(long v) { return static_cast<std::size_t>(v); }

struct Layer {
  Matrix w, b;  // [n, k], [n]
};

Matrix apply(const Layer& l, const Matrix& x, long rows) {
  const long n = static_cast<long>(l.b.size()), k = static_cast<long>(l.w.size()) / n;
  Matrix y(u(rows * n));
  for (long r = 0; r < rows; ++r)
    for (long j = 0; j < n; ++j) {
      double sum = l.b[u(j)];
      for (long i = 0; i < k; ++i) sum += l.w[u(j * k + i)] * x[u(r * k + i)];
      y[u(r * n + j)] = sum;
    }
  return y;
}

Matrix silu(Matrix x) {
  for (double& v : x) v = ref::silu(v);
  return x;
}

Matrix doubles(const std::vector<float>& x) { return {x.begin(), x.end()}; }

// d loss / d x by central differences.
std::vector<double> layer_differences(Matrix& x, const std::function<double()>& loss) {
  return ref::central_differences(x, 1e-5, loss);
}

class Layers : public test::FlavourTest {
 protected:
  Layers() : config_(named_config("micro")), host_(initial_weights(config_, 5)) {
    for (const auto& [name, t] : std::map<std::string, HostTensor>(host_.all())) {
      HostTensor other = t;  // biases of the heads begin at zero
      const auto more = random_floats(t.data.size(), 17, -0.2f, 0.2f);
      for (std::size_t i = 0; i < more.size(); ++i) other.data[i] += more[i];
      host_.set(name, other);
    }
    learnt_ = std::make_unique<LearntWeights>(ctx(), config_, host_);
  }
  LayerBuilder<WeightLoader> layers() { return layers_of(ctx(), *learnt_); }
  Layer layer(const std::string& name) const {
    return {doubles(host_.at(name + ".weight").data), doubles(host_.at(name + ".bias").data)};
  }
  std::vector<float> gradient(const std::string& name) { return ctx().read<float>(learnt_->at(name).gradient); }

  Config config_;
  Weights host_;
  std::unique_ptr<LearntWeights> learnt_;
};
VSPLAT_FLAVOURS(Layers);

// Two inputs side by side; a second gradient is added to the first.
TEST_P(Layers, LinearOfTwoInputs) {
  const std::string name = "voxel_network.comp_linear";
  for (const long rows : {1L, 3L, 29L}) {
    SCOPED_TRACE(rows);
    learnt_->zero_gradients(ctx());
    const long in = config_.projected_ch() + config_.volume_ch + 63, out = config_.voxel_ch,
               c0 = config_.projected_ch();
    const Linear linear = layers().linear(name, in, out);
    const auto x0 = random_floats(u(rows * c0), 1), x1 = random_floats(u(rows * (in - c0)), 2);
    const auto dy = random_floats(u(rows * out), 3);
    LinearBackward b;
    b.in.x0 = ctx().upload({rows, c0}, x0);
    b.in.x1 = ctx().upload({rows, in - c0}, x1);
    b.dy = ctx().upload({rows, out}, dy);
    b.dx0 = ctx().upload({rows, c0}, test::nans(u(rows * c0)));
    b.dx1 = ctx().upload({rows, in - c0}, test::nans(u(rows * (in - c0))));
    linear_backward(ctx(), linear, b);
    b.add = true;
    linear_backward(ctx(), linear, b);

    const Layer l = layer(name);
    Matrix dw(l.w.size()), db(l.b.size()), dx0(x0.size()), dx1(x1.size());
    for (long r = 0; r < rows; ++r)
      for (long j = 0; j < out; ++j) {
        const double g = 2 * static_cast<double>(dy[u(r * out + j)]);
        db[u(j)] += g;
        for (long i = 0; i < in; ++i) {
          const float x = i < c0 ? x0[u(r * c0 + i)] : x1[u(r * (in - c0) + i - c0)];
          dw[u(j * in + i)] += g * x;
          (i < c0 ? dx0[u(r * c0 + i)] : dx1[u(r * (in - c0) + i - c0)]) += g * l.w[u(j * in + i)];
        }
      }
    EXPECT_TRUE(test::close(gradient(name + ".weight"), dw, 1e-5));
    EXPECT_TRUE(test::close(gradient(name + ".bias"), db, 1e-5));
    EXPECT_TRUE(test::close(ctx().read<float>(b.dx0), dx0, 1e-5));
    EXPECT_TRUE(test::close(ctx().read<float>(b.dx1), dx1, 1e-5));
  }
}

TEST_P(Layers, Mlp3AgreesWithDifferences) {
  const std::string name = "predictor.coarse_predictor";
  constexpr long rows = 5;
  const long in = config_.volume_ch, out = config_.primitive_size();
  const Mlp3 mlp = layers().mlp3(name, in, out);
  const auto x = random_floats(u(rows * in), 1), dy = random_floats(u(rows * out), 2);
  Layer first = layer(name + ".0"), second = layer(name + ".2"), third = layer(name + ".4");
  Matrix input = doubles(x);
  const auto value = [&] { return apply(third, silu(apply(second, silu(apply(first, input, rows)), rows)), rows); };
  const auto loss = [&] { return ref::weighed(value(), dy); };

  Mlp3Saved saved;
  const Tensor on_device = ctx().upload({rows, in}, x);
  const Tensor y = mlp3_forward(ctx(), mlp, on_device, "mlp", &saved);
  EXPECT_TRUE(test::close(ctx().read<float>(y), value(), 1e-5));
  EXPECT_TRUE(test::close(ctx().read<float>(mlp3_forward(ctx(), mlp, on_device, "mlp")), value(), 1e-5));
  const Tensor dx = ctx().upload({rows, in}, test::nans(x.size()));
  mlp3_backward(ctx(), mlp, saved, ctx().upload({rows, out}, dy), dx, false, "mlp");
  EXPECT_TRUE(test::close(ctx().read<float>(dx), layer_differences(input, loss), 2e-5));
  EXPECT_TRUE(test::close(gradient(name + ".0.weight"), layer_differences(first.w, loss), 2e-5));
  EXPECT_TRUE(test::close(gradient(name + ".0.bias"), layer_differences(first.b, loss), 2e-5));
  EXPECT_TRUE(test::close(gradient(name + ".2.weight"), layer_differences(second.w, loss), 2e-5));
  EXPECT_TRUE(test::close(gradient(name + ".4.weight"), layer_differences(third.w, loss), 2e-5));
  EXPECT_TRUE(test::close(gradient(name + ".4.bias"), layer_differences(third.b, loss), 2e-5));
}

// GroupNorm and SiLU of two inputs, whose gradients arrive side by side from the next layer.
TEST_P(Layers, NormSiluOfTwoInputsAgreesWithDifferences) {
  const std::string name = "voxel_network.norm_out.group_norm";
  constexpr long rows = 7;
  const long c0 = config_.voxel_ch, c = c0 + config_.projected_ch();
  const GroupNorm norm = layers().group_norm(name, c, config_.groups);
  const auto x0 = random_floats(u(rows * c0), 1), x1 = random_floats(u(rows * (c - c0)), 2);
  const auto dy = random_floats(u(rows * c), 3);
  Matrix a = doubles(x0), b = doubles(x1);
  Matrix gamma = doubles(host_.at(name + ".weight").data), beta = doubles(host_.at(name + ".bias").data);
  const auto loss = [&] {
    const auto at = [&](long r, long i) { return i < c0 ? a[u(r * c0 + i)] : b[u(r * (c - c0) + i - c0)]; };
    double sum = 0;
    const long width = c / config_.groups;
    for (long g = 0; g < config_.groups; ++g) {
      double mean = 0, variance = 0;
      for (long r = 0; r < rows; ++r)
        for (long i = g * width; i < (g + 1) * width; ++i) mean += at(r, i);
      mean /= static_cast<double>(rows * width);
      for (long r = 0; r < rows; ++r)
        for (long i = g * width; i < (g + 1) * width; ++i) variance += (at(r, i) - mean) * (at(r, i) - mean);
      const double rstd = 1 / std::sqrt(variance / static_cast<double>(rows * width) + 1e-6);
      for (long r = 0; r < rows; ++r)
        for (long i = g * width; i < (g + 1) * width; ++i)
          sum += dy[u(r * c + i)] * ref::silu((at(r, i) - mean) * rstd * gamma[u(i)] + beta[u(i)]);
    }
    return sum;
  };

  NormSaved saved;
  norm_silu_forward(ctx(), norm, ctx().upload({rows, c0}, x0), ctx().upload({rows, c - c0}, x1), &saved);
  const Tensor dx0 = ctx().upload({rows, c0}, x0), dx1 = ctx().upload({rows, c - c0}, x1);
  norm_silu_backward(ctx(), norm, saved, ctx().upload({rows, c}, dy), dx0, dx1, true);  // added to x0 and x1
  auto want0 = layer_differences(a, loss), want1 = layer_differences(b, loss);
  for (std::size_t i = 0; i < want0.size(); ++i) want0[i] += x0[i];
  for (std::size_t i = 0; i < want1.size(); ++i) want1[i] += x1[i];
  EXPECT_TRUE(test::close(ctx().read<float>(dx0), want0, 2e-5));
  EXPECT_TRUE(test::close(ctx().read<float>(dx1), want1, 2e-5));
  EXPECT_TRUE(test::close(gradient(name + ".weight"), layer_differences(gamma, loss), 2e-5));
  EXPECT_TRUE(test::close(gradient(name + ".bias"), layer_differences(beta, loss), 2e-5));
}

}  // namespace
}  // namespace vsplat
