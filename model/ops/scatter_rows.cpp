#include "model/ops/scatter_rows.h"

#include <bit>
#include <cstdint>

#include "model/ops/radix_sort.h"
#include "runtime/shape_check.h"

namespace vsplat {

ScatterPlan make_scatter_plan(Context& ctx, const Tensor& index, const Tensor& weight, long rows) {
  const long entries = index.count();
  if (index.type() != Type::i32 || weight.type() != Type::f32 || weight.shape() != index.shape())
    fail(Status::internal, "scatter plan: index is {}, weight {}; i32 and f32 of one shape expected", index.describe(),
         weight.describe());
  if (rows < 0 || rows >= (1L << 31) || entries >= (1L << 31))
    fail(Status::memory, "scatter plan: {} entries to {} rows, at most 2147483647 of each are possible", entries, rows);
  const double e = static_cast<double>(entries);
  const auto E = static_cast<unsigned>(entries), R = static_cast<unsigned>(rows);
  Tensor keys = ctx.tensor({entries}, Type::u32, "scatter.keys");
  ctx.launch({"scatter_rows", "scatter_keys", ""}, items(entries), {0, 12 * e}, index, weight, keys, E, R);
  const int bits = std::bit_width(static_cast<std::uint64_t>(rows));  // those passed over have the key `rows`
  const Sorted sorted = radix_sort(ctx, std::move(keys), Tensor(), bits);
  ScatterPlan plan;
  plan.rows = rows;
  plan.from = sorted.values;
  plan.weight = ctx.tensor({entries}, Type::f32, "scatter.weight");
  plan.starts = ctx.tensor({rows + 1}, Type::u32, "scatter.starts");
  ctx.launch({"scatter_rows", "scatter_plan", ""}, items(entries + 1), {0, 16 * e + 4.0 * static_cast<double>(rows)},
             sorted.keys, plan.from, weight, plan.weight, plan.starts, E, R);
  return plan;
}

void scatter_rows(Context& ctx, const ScatterRows& a) {
  if (!a.plan) fail(Status::internal, "scatter_rows: no plan");
  Dims d;
  d.set("rows", a.plan->rows).bind("out", a.out, {"rows", "C"}).bind("d", a.d, {"D", "C"});
  const long entries = a.plan->from.count(), c = d["C"];
  if (a.per_row < 1 || a.first < 0 || a.first + (entries + a.per_row - 1) / a.per_row > d["D"])
    fail(Status::internal, "scatter_rows: {} entries, {} to a row, from row {} of {}", entries, a.per_row, a.first,
         a.d.describe());
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const long lanes = cpu ? 16 : 4, parts = (c + lanes - 1) / lanes;
  const Range range = cpu ? groups(parts, 1, a.plan->rows) : groups((parts + 31) / 32, 32, a.plan->rows);
  const double terms = static_cast<double>(entries) * static_cast<double>(c);
  ctx.launch({"scatter_rows", "scatter_rows", cpu ? "-DLANES=16" : "-DLANES=4"}, range,
             {2 * terms, 4 * terms + 2.0 * static_cast<double>(a.out.bytes())}, a.d, a.plan->from, a.plan->weight,
             a.plan->starts, a.out, static_cast<int>(a.plan->rows), static_cast<int>(c), static_cast<unsigned>(a.first),
             static_cast<unsigned>(a.per_row), a.scale);
}

}  // namespace vsplat
