// Sorting, whose results are either right or wrong.
#include <numeric>

#include "model/diagnose/tune/sample.h"
#include "model/diagnose/tune/tune_cases.h"
#include "model/ops/render/radix_sort.h"

namespace vsplat::tuning {
namespace {

constexpr long kMostKeys = 4 << 20;

class SortCase : public TuneCase {
 public:
  SortCase(Context& ctx, long keys, long bits) : bits_(bits) {
    std::mt19937_64 engine(1);
    const std::uint64_t mask = bits >= 64 ? ~0ull : (1ull << bits) - 1;
    for (long i = 0; i < std::min(keys, kMostKeys); ++i) keys_.push_back(engine() & mask);
    narrow_.assign(keys_.begin(), keys_.end());
    const Shape shape{static_cast<long>(keys_.size())};
    wide_ = bits > 32;
    from_ = wide_ ? ctx.upload(shape, keys_, Type::u64) : ctx.upload(shape, narrow_, Type::u32);
    flops = static_cast<double>(keys_.size()) * static_cast<double>(bits);
  }

  std::function<void()> ready(Context& ctx) override {
    return [this, &ctx] {
      sorted_ = {};  // frees memory for the next one
      const Tensor keys = ctx.tensor(from_.shape(), from_.type(), "keys");
      ctx.copy(from_, keys);  // the sort overwrites it
      sorted_ = radix_sort(ctx, keys, {}, static_cast<int>(bits_));
    };
  }

  std::vector<Tensor> outputs() const override { return {sorted_.keys, sorted_.values}; }

  // A run allocates new tensors: fills the memory that they will get.
  void spoil(Context& ctx) override {
    sorted_ = {};
    Sorted both[2];
    for (Sorted& one : both) {
      one = {ctx.tensor(from_.shape(), from_.type(), "keys"), ctx.tensor(from_.shape(), Type::u32, "values")};
      sorted_ = one;
      TuneCase::spoil(ctx);
    }
  }

  double error(Context& ctx) override {
    const std::vector<std::uint32_t> got = ctx.read<std::uint32_t>(sorted_.values);
    const std::vector<std::uint64_t> keys = sorted_keys(ctx);
    if (want_.empty()) {
      want_.resize(keys_.size());
      std::iota(want_.begin(), want_.end(), 0u);
      std::stable_sort(want_.begin(), want_.end(),
                       [&](std::uint32_t a, std::uint32_t b) { return keys_[a] < keys_[b]; });
    }
    long wrong = 0;
    for (std::size_t i = 0; i < got.size(); ++i) wrong += got[i] != want_[i] || keys[i] != keys_[want_[i]];
    return static_cast<double>(wrong) / static_cast<double>(std::max<std::size_t>(got.size(), 1));
  }
  double tolerance() const override { return 0; }

 private:
  std::vector<std::uint64_t> sorted_keys(Context& ctx) const {
    if (wide_) return ctx.read<std::uint64_t>(sorted_.keys);
    const std::vector<std::uint32_t> narrow = ctx.read<std::uint32_t>(sorted_.keys);
    return {narrow.begin(), narrow.end()};
  }

  long bits_;
  bool wide_ = false;
  std::vector<std::uint64_t> keys_;
  std::vector<std::uint32_t> narrow_, want_;
  Tensor from_;
  Sorted sorted_;
};

}  // namespace

std::unique_ptr<TuneCase> sort_case(Context& ctx, const TunedShape& shape) {
  if (shape.op != TunedOp::radix_sort) return nullptr;
  return std::make_unique<SortCase>(ctx, shape.sizes[0], shape.sizes[1]);
}

}  // namespace vsplat::tuning

namespace vsplat {

void TuneCase::spoil(Context& ctx) {
  for (const Tensor& out : outputs()) {
    const std::vector<unsigned char> nothing(out.bytes(), 0xff);  // NaN as a float, out of range as an index
    ctx.write(out, nothing.data());
  }
}

std::unique_ptr<TuneCase> tune_case(Context& ctx, const TunedShape& shape) {
  using namespace tuning;
  for (const auto& family : {product_case, attention_case, sort_case, rasterize_case})
    if (auto out = family(ctx, shape)) return out;
  return nullptr;
}

TunedShape odd_shape(const TunedShape& like) {
  TunedShape out = like;
  switch (like.op) {
    case TunedOp::gemm: {
      const long taps = std::max(1L, like.sizes[3]);
      out.sizes = {131, 77, 19 * taps, taps};
      break;
    }
    case TunedOp::gemm_transposed:
      out.sizes = {1571, 67, 41};
      break;
    case TunedOp::conv3d:
    case TunedOp::conv3d_winograd:
    case TunedOp::conv3d_weights:
      out.sizes = {7 * 7 * 7, 19, 37};
      break;
    case TunedOp::conv3d_method:
      out.sizes = {33, 35};
      break;
    case TunedOp::attention_forward:
    case TunedOp::attention_backward:
      out.sizes = {3, 139, like.sizes[2]};
      break;
    case TunedOp::radix_sort:
      out.sizes = {5003, like.sizes[1]};
      break;
    case TunedOp::rasterize_forward:
      out.sizes = {9, 9 * 37};
      break;
  }
  return out;
}

}  // namespace vsplat
