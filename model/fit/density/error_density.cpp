// Splits where the pictures' errors are (Rota Bulo et al. 2024).
#include "model/fit/density/density.h"
#include "model/ops/fit/splat_split.h"

namespace vsplat {
namespace {

class ErrorDensity : public Density {
 public:
  ErrorDensity(Context& ctx, long capacity) : scores_(ctx.tensor({capacity}, Type::f32, "scores")) {
    ctx.fill_zero(scores_);
  }

  long grow(Context& ctx, const GrowStep& s) override {
    const long count = splat_split(ctx, {s.all, s.count, s.grow_to, scores_.first(s.count)});
    ctx.fill_zero(scores_);
    return count;
  }

  Tensor scores() const override { return scores_; }

 private:
  Tensor scores_;
};

}  // namespace

std::unique_ptr<Density> make_error_density(Context& ctx, long capacity) {
  return std::make_unique<ErrorDensity>(ctx, capacity);
}

}  // namespace vsplat
