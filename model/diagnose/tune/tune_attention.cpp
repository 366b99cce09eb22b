// Attention, forward and backward.
#include "model/diagnose/tune/sample.h"
#include "model/diagnose/tune/tune_cases.h"
#include "model/ops/dense/attention.h"

namespace vsplat::tuning {
namespace {

constexpr int kTokens = 16;  // tokens checked, of the first and of the last head

// The heads of one view.
class AttentionCase : public TuneCase {
 public:
  AttentionCase(Context& ctx, long heads, long tokens, long channels, bool backward)
      : h_(heads), t_(tokens), d_(channels), backward_(backward) {
    qkv_ = numbers(t_ * 3 * h_ * d_, 1);
    a_.qkv = ctx.upload({1, t_, 3, h_, d_}, qkv_);
    a_.out = ctx.tensor({1, t_, h_ * d_});
    flops = 4.0 * static_cast<double>(h_ * d_) * static_cast<double>(t_) * static_cast<double>(t_);
    if (!backward_) return;
    flops *= 2.5;
    dout_ = numbers(t_ * h_ * d_, 2);
    a_.stats = ctx.tensor({1, h_, t_, 2});
    g_.dout = ctx.upload({1, t_, h_ * d_}, dout_);
    g_.dqkv = ctx.tensor({1, t_, 3, h_, d_});
    g_.qkv = a_.qkv, g_.out = a_.out, g_.stats = a_.stats;
  }

  std::function<void()> ready(Context& ctx) override {
    if (!backward_) return [this, &ctx] { attention_forward(ctx, a_); };
    attention_forward(ctx, a_);
    return [this, &ctx] { attention_backward(ctx, g_); };
  }

  std::vector<Tensor> outputs() const override { return {backward_ ? g_.dqkv : a_.out}; }

  double error(Context& ctx) override {
    const std::vector<float> got = ctx.read<float>(backward_ ? g_.dqkv : a_.out);
    WorstError worst[3];
    for (const long h : {0L, h_ - 1}) {
      if (backward_)
        check_gradients(got, h, worst);
      else
        for (const long t : sampled(t_, kTokens)) check_row(got, h, t, worst[0]);
    }
    double out = worst[0].of_largest();
    for (int i = 1; backward_ && i < 3; ++i)  // queries, keys and values have different scales
      out = std::max(out, worst[i].of_largest());
    return out;
  }

 private:
  double in(long which, long t, long h, long d) const {
    return static_cast<double>(qkv_[static_cast<std::size_t>(((t * 3 + which) * h_ + h) * d_ + d)]);
  }
  double dout(long t, long h, long d) const {
    return static_cast<double>(dout_[static_cast<std::size_t>((t * h_ + h) * d_ + d)]);
  }

  // A query's weights of all keys.
  std::vector<double> weights(long h, long t) const {
    std::vector<double> out(static_cast<std::size_t>(t_));
    double largest = -INFINITY, sum = 0;
    for (long j = 0; j < t_; ++j) {
      double score = 0;
      for (long d = 0; d < d_; ++d) score += in(0, t, h, d) * in(1, j, h, d);
      out[static_cast<std::size_t>(j)] = score / std::sqrt(static_cast<double>(d_));
      largest = std::max(largest, out[static_cast<std::size_t>(j)]);
    }
    for (double& w : out) sum += w = std::exp(w - largest);
    for (double& w : out) w /= sum;
    return out;
  }

  void check_row(const std::vector<float>& got, long h, long t, WorstError& worst) const {
    const std::vector<double> p = weights(h, t);
    for (long d = 0; d < d_; ++d) {
      double want = 0;
      for (long j = 0; j < t_; ++j) want += p[static_cast<std::size_t>(j)] * in(2, j, h, d);
      worst.add(static_cast<double>(got[static_cast<std::size_t>((t * h_ + h) * d_ + d)]), want);
    }
  }

  // A query's scores, and its weights.
  std::vector<double> by_scores(long h, long t, const std::vector<double>& p) const {
    std::vector<double> out(p.size());
    double along = 0;
    for (long j = 0; j < t_; ++j) {
      double dp = 0;
      for (long d = 0; d < d_; ++d) dp += dout(t, h, d) * in(2, j, h, d);
      out[static_cast<std::size_t>(j)] = dp;
      along += dp * p[static_cast<std::size_t>(j)];
    }
    for (std::size_t j = 0; j < out.size(); ++j) out[j] = p[j] * (out[j] - along) / std::sqrt(static_cast<double>(d_));
    return out;
  }

  void check_gradients(const std::vector<float>& got, long h, WorstError (&worst)[3]) const {
    const std::vector<long> tokens = sampled(t_, kTokens);
    const auto wide = static_cast<std::size_t>(d_);
    std::vector<double> dk(tokens.size() * wide), dv(tokens.size() * wide), dq(wide);
    const auto compare = [&](long which, long t, const double* want) {
      for (long d = 0; d < d_; ++d)
        worst[which].add(static_cast<double>(got[static_cast<std::size_t>(((t * 3 + which) * h_ + h) * d_ + d)]),
                         want[d]);
    };
    for (long i = 0; i < t_; ++i) {
      const std::vector<double> p = weights(h, i), ds = by_scores(h, i, p);
      for (std::size_t s = 0; s < tokens.size(); ++s)
        for (std::size_t d = 0; d < wide; ++d) {
          const auto j = static_cast<std::size_t>(tokens[s]);
          dk[s * wide + d] += ds[j] * in(0, i, h, static_cast<long>(d));
          dv[s * wide + d] += p[j] * dout(i, h, static_cast<long>(d));
        }
      if (std::find(tokens.begin(), tokens.end(), i) == tokens.end()) continue;
      for (std::size_t d = 0; d < wide; ++d) {
        dq[d] = 0;
        for (long j = 0; j < t_; ++j) dq[d] += ds[static_cast<std::size_t>(j)] * in(1, j, h, static_cast<long>(d));
      }
      compare(0, i, dq.data());
    }
    for (std::size_t s = 0; s < tokens.size(); ++s) {
      compare(1, tokens[s], dk.data() + s * wide);
      compare(2, tokens[s], dv.data() + s * wide);
    }
  }

  long h_, t_, d_;
  bool backward_;
  std::vector<float> qkv_, dout_;
  AttentionForward a_;
  AttentionBackward g_;
};

}  // namespace

std::unique_ptr<TuneCase> attention_case(Context& ctx, const TunedShape& shape) {
  const auto& s = shape.sizes;
  if (shape.op != TunedOp::attention_forward && shape.op != TunedOp::attention_backward) return nullptr;
  return std::make_unique<AttentionCase>(ctx, s[0], s[1], s[2], shape.op == TunedOp::attention_backward);
}

}  // namespace vsplat::tuning
