// The cases by families, for tune_case().
#pragma once
#include "model/diagnose/tune/tune_case.h"

namespace vsplat::tuning {

// Null if the operation does not belong to the family.
std::unique_ptr<TuneCase> product_case(Context& ctx, const TunedShape& shape);
std::unique_ptr<TuneCase> attention_case(Context& ctx, const TunedShape& shape);
std::unique_ptr<TuneCase> rasterize_case(Context& ctx, const TunedShape& shape);
std::unique_ptr<TuneCase> sort_case(Context& ctx, const TunedShape& shape);

}  // namespace vsplat::tuning
