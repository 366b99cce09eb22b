// Matrix products and convolutions.
#include "model/diagnose/tune/sample.h"
#include "model/diagnose/tune/tune_cases.h"
#include "model/ops/dense/conv3d.h"

namespace vsplat::tuning {
namespace {

constexpr int kSamples = 300;

std::size_t at(long i) { return static_cast<std::size_t>(i); }
double product(float a, float b) { return static_cast<double>(a) * static_cast<double>(b); }

// Operations with one output, whose values are sums.
class Sums : public TuneCase {
 public:
  std::vector<Tensor> outputs() const override { return {out_}; }

  double error(Context& ctx) override {
    const std::vector<float> got = ctx.read<float>(out_);
    WorstError worst;
    for (const long i : sampled(out_.count(), kSamples)) worst.add(static_cast<double>(got[at(i)]), want(i));
    return worst.of_largest();
  }

 protected:
  virtual double want(long i) const = 0;
  Tensor out_;
};

// Rows of A as stored, or gathered: neighbours in a sheet of voxels, two in five of them absent.
class GemmCase : public Sums {
 public:
  GemmCase(Context& ctx, long m, long n, long k, long taps) : n_(n), k_(k), taps_(std::max(1L, taps)) {
    const long c = k / taps_;
    a_ = numbers(m * c, 1), b_ = numbers(n * k, 2), bias_ = numbers(n, 3);
    gemm_.a.x0 = ctx.upload({m, c}, a_);
    gemm_.bias = ctx.upload({n}, bias_);
    if (taps_ > 1) {
      std::mt19937 engine(1);
      for (long i = 0; i < m * taps_; ++i) {
        const long near = i / taps_ + (i % taps_ - taps_ / 2) * 7;
        map_.push_back(near < 0 || near >= m || engine() % 5 < 2 ? -1 : static_cast<int>(near));
      }
      gemm_.a.map = ctx.upload({m, taps_}, map_, Type::i32);
    }
    out_ = ctx.tensor({m, n});
    gemm_.out = out_;
    flops = 2.0 * static_cast<double>(m * n) * static_cast<double>(k);
  }

  std::function<void()> ready(Context& ctx) override {
    packed_ = pack_matrix(ctx, b_.data(), k_, n_, 1, k_, "B");
    gemm_.b = &packed_;
    return [this, &ctx] { gemm(ctx, gemm_); };
  }

 private:
  double want(long i) const override {
    const long m = i / n_, n = i % n_, c = k_ / taps_;
    double sum = static_cast<double>(bias_[at(n)]);
    for (long t = 0; t < taps_; ++t) {
      const long row = map_.empty() ? m : map_[at(m * taps_ + t)];
      for (long j = 0; row >= 0 && j < c; ++j) sum += product(a_[at(row * c + j)], b_[at(n * k_ + t * c + j)]);
    }
    return sum;
  }

  long n_, k_, taps_;
  std::vector<float> a_, b_, bias_;
  std::vector<int> map_;
  PackedMatrix packed_;
  Gemm gemm_;
};

class TransposedCase : public Sums {
 public:
  TransposedCase(Context& ctx, long rows, long m, long n) : rows_(rows), m_(m), n_(n) {
    a_ = numbers(rows * m, 1), b_ = numbers(rows * n, 2);
    gemm_.a = ctx.upload({rows, m}, a_), gemm_.b = ctx.upload({rows, n}, b_);
    out_ = ctx.tensor({m, n});
    gemm_.out = out_;
    flops = 2.0 * static_cast<double>(m * n) * static_cast<double>(rows);
  }

  std::function<void()> ready(Context& ctx) override {
    return [this, &ctx] { transposed_gemm(ctx, gemm_); };
  }

 private:
  double want(long i) const override {
    double sum = 0;
    for (long r = 0; r < rows_; ++r) sum += product(a_[at(r * m_ + i / n_)], b_[at(r * n_ + i % n_)]);
    return sum;
  }

  long rows_, m_, n_;
  std::vector<float> a_, b_;
  TransposedGemm gemm_;
};

// Volumes are cubes, so the number of voxels gives the side.
class ConvCase : public Sums {
 public:
  ConvCase(Context& ctx, long voxels, long cin, long cout, ConvMethod method)
      : side_(std::max(1L, std::lround(std::cbrt(static_cast<double>(voxels))))),
        cin_(cin),
        cout_(cout),
        method_(method) {
    const long there = side_ * side_ * side_;
    x_ = numbers(there * cin, 1), w_ = numbers(27 * cin * cout, 2), bias_ = numbers(cout, 3);
    conv_.in.x0 = ctx.upload({there, cin}, x_);
    conv_.x = conv_.y = conv_.z = side_;
    out_ = ctx.tensor({there, cout});
    conv_.out = out_;
    flops = 54.0 * static_cast<double>(there * cin) * static_cast<double>(cout);
  }

  // A run owns its weights, since methods run side by side.
  std::function<void()> ready(Context& ctx) override {
    const auto weights =
        std::make_shared<ConvWeights>(pack_conv3d(ctx, w_.data(), bias_.data(), cout_, cin_, "weights", method_));
    return [this, &ctx, weights] {
      Conv3dForward c = conv_;
      c.weights = weights.get();
      conv3d_forward(ctx, c);
    };
  }

 private:
  double want(long i) const override {
    const long n = i % cout_, voxel = i / cout_;
    const long x = voxel / (side_ * side_), y = voxel / side_ % side_, z = voxel % side_;
    double sum = static_cast<double>(bias_[at(n)]);
    for (long t = 0; t < 27; ++t) {
      const long px = x + t / 9 - 1, py = y + t / 3 % 3 - 1, pz = z + t % 3 - 1;
      if (std::min({px, py, pz}) < 0 || std::max({px, py, pz}) >= side_) continue;
      const long from = ((px * side_ + py) * side_ + pz) * cin_;
      for (long c = 0; c < cin_; ++c) sum += product(x_[at(from + c)], w_[at((n * cin_ + c) * 27 + t)]);
    }
    return sum;
  }

  long side_, cin_, cout_;
  ConvMethod method_;
  std::vector<float> x_, w_, bias_;
  Conv3dForward conv_;
};

class ConvWeightsCase : public Sums {
 public:
  ConvWeightsCase(Context& ctx, long voxels, long cin, long cout)
      : side_(std::max(1L, std::lround(std::cbrt(static_cast<double>(voxels))))), cin_(cin), cout_(cout) {
    const long there = side_ * side_ * side_;
    x_ = numbers(there * cin, 1), dy_ = numbers(there * cout, 2);
    g_.in.x0 = ctx.upload({there, cin}, x_);
    g_.x = g_.y = g_.z = side_;
    g_.dy = ctx.upload({there, cout}, dy_);
    g_.method = ConvMethod::direct;
    out_ = ctx.tensor({cout, cin, 3, 3, 3});
    g_.dw = out_;
    flops = 54.0 * static_cast<double>(there * cin) * static_cast<double>(cout);
  }

  std::function<void()> ready(Context& ctx) override {
    return [this, &ctx] {
      ctx.fill_zero(g_.dw);  // the kernel adds to it
      conv3d_backward_weights(ctx, g_);
    };
  }

 private:
  double want(long i) const override {
    const long t = i % 27, c = i / 27 % cin_, n = i / 27 / cin_;
    const long dx = t / 9 - 1, dy = t / 3 % 3 - 1, dz = t % 3 - 1;
    double sum = 0;
    for (long x = std::max(0L, -dx); x < std::min(side_, side_ - dx); ++x)
      for (long y = std::max(0L, -dy); y < std::min(side_, side_ - dy); ++y)
        for (long z = std::max(0L, -dz); z < std::min(side_, side_ - dz); ++z) {
          const long to = (x * side_ + y) * side_ + z, from = ((x + dx) * side_ + y + dy) * side_ + z + dz;
          sum += product(x_[at(from * cin_ + c)], dy_[at(to * cout_ + n)]);
        }
    return sum;
  }

  long side_, cin_, cout_;
  std::vector<float> x_, dy_;
  Conv3dBackwardWeights g_;
};

}  // namespace

std::unique_ptr<TuneCase> product_case(Context& ctx, const TunedShape& shape) {
  const auto& s = shape.sizes;
  switch (shape.op) {
    case TunedOp::gemm:
      return std::make_unique<GemmCase>(ctx, s[0], s[1], s[2], s[3]);
    case TunedOp::gemm_transposed:
      return std::make_unique<TransposedCase>(ctx, s[0], s[1], s[2]);
    case TunedOp::conv3d:
      return std::make_unique<ConvCase>(ctx, s[0], s[1], s[2], ConvMethod::direct);
    case TunedOp::conv3d_winograd:
      return std::make_unique<ConvCase>(ctx, s[0], s[1], s[2], ConvMethod::winograd);
    case TunedOp::conv3d_method:  // for volumes large enough that the choice matters
      return std::make_unique<ConvCase>(ctx, 16 * 16 * 16, s[0], s[1], ConvMethod::auto_);
    case TunedOp::conv3d_weights:
      return std::make_unique<ConvWeightsCase>(ctx, s[0], s[1], s[2]);
    default:
      return nullptr;
  }
}

}  // namespace vsplat::tuning
