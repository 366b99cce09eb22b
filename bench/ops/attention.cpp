#include "model/ops/dense/attention.h"

#include <memory>

#include "bench/ops/operation.h"
#include "bench/references.h"
#include "bench/sums.h"
#include "model/diagnose/selftest/reference/attention.h"
#include "runtime/gemm_pairs.h"

namespace vsplat::bench {
namespace {

constexpr long kTokenRows = kTokens * kTokens + 1, kViewHeads = 12, kViewHeadSize = kDim / kViewHeads;

constexpr double kPairsTolerance = 2e-2;  // of rounded operands

// With enough spread that the weights differ.
std::vector<float> queries_keys_values() { return random_floats(kViews * kTokenRows * 3 * kDim, 1, -2.0f, 2.0f); }

Prepared prepare_attention(Context& ctx, bool references) {
  const auto host = std::make_shared<std::vector<float>>(queries_keys_values());
  AttentionForward a{ctx.upload({kViews, kTokenRows, 3, kViewHeads, kViewHeadSize}, *host),
                     ctx.tensor({kViews, kTokenRows, kDim}), ctx.tensor({kViews, kViewHeads, kTokenRows, 2})};
  Prepared p = operation(ctx, [&ctx, a] { attention_forward(ctx, a); }, {a.out, a.stats});
  const auto want = [host](long i) { return attention_at(*host, kTokenRows, kViewHeads, kDim, i / kDim, i % kDim); };
  if (wants_pairs(ctx, kViewHeadSize, kTokenRows)) p.tolerance = kPairsTolerance;
  p.error = [&ctx, a, want] {
    const auto got = ctx.read<float>(a.out);
    return worst_error(
        static_cast<long>(got.size()), 100, [&](long i) { return got[static_cast<std::size_t>(i)]; }, want);
  };
  if (references)
    References::add_attention(
        ctx, p, [&] { return References::Attention{kViews, kTokenRows, kViewHeads, kViewHeadSize, *host, want}; });
  return p;
}

// The last head of the last view, whole: every query's gradient goes into every key's.
double backward_error(Context& ctx, const AttentionBackward& a, const std::vector<float>& qkv,
                      const std::vector<float>& dout) {
  const auto got = ctx.read<float>(a.dqkv);
  std::vector<float> of_head, there;
  std::vector<double> by;
  for (long token = 0; token < kTokenRows; ++token)
    for (long i = 0; i < 4 * kViewHeadSize; ++i) {
      const long row = (kViews - 1) * kTokenRows + token, n = kDim - kViewHeadSize + i % kViewHeadSize,
                 part = i / kViewHeadSize;
      if (part == 3) {
        by.push_back(static_cast<double>(dout[static_cast<std::size_t>(row * kDim + n)]));
        continue;
      }
      const auto at = static_cast<std::size_t>((row * 3 + part) * kDim + n);
      of_head.push_back(qkv[at]), there.push_back(got[at]);
    }
  const std::vector<double> want = ref::attention_backward(of_head, 1, kTokenRows, 1, kViewHeadSize, by);
  double worst = 0;
  for (const long part : {0, 1, 2}) {  // those of queries, keys and values are of different sizes
    const auto place = [&](long i) {
      return static_cast<std::size_t>((i / kViewHeadSize * 3 + part) * kViewHeadSize + i % kViewHeadSize);
    };
    const double error = worst_error(
        kTokenRows * kViewHeadSize, 1000, [&](long i) { return there[place(i)]; },
        [&](long i) { return want[place(i)]; });
    if (!(error <= worst)) worst = error;
  }
  return worst;
}

Prepared prepare_attention_backward(Context& ctx) {
  const auto host = std::make_shared<std::vector<float>>(queries_keys_values());
  const auto dout = std::make_shared<std::vector<float>>(random_floats(kViews * kTokenRows * kDim, 2));
  const AttentionForward f{ctx.upload({kViews, kTokenRows, 3, kViewHeads, kViewHeadSize}, *host),
                           ctx.tensor({kViews, kTokenRows, kDim}), ctx.tensor({kViews, kViewHeads, kTokenRows, 2})};
  attention_forward(ctx, f);
  AttentionBackward a{f.qkv, f.out, f.stats, ctx.upload(f.out.shape(), *dout), ctx.tensor(f.qkv.shape())};
  Prepared p = operation(ctx, [&ctx, a] { attention_backward(ctx, a); }, {a.dqkv});
  if (wants_pairs(ctx, kViewHeadSize, kTokenRows)) p.tolerance = kPairsTolerance;
  p.error = [&ctx, a, host, dout] { return backward_error(ctx, a, *host, *dout); };
  return p;
}

}  // namespace

std::vector<Case> attention_cases(const Options& options) {
  return {
      {"forward", [references = options.references](Context& ctx) { return prepare_attention(ctx, references); }},
      {"backward", prepare_attention_backward},
  };
}

}  // namespace vsplat::bench
