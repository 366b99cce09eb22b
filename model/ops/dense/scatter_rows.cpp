#include "model/ops/dense/scatter_rows.h"

#include <bit>
#include <cstdint>

#include "model/ops/render/radix_sort.h"
#include "runtime/fail.h"
#include "runtime/gemm.h"
#include "runtime/shape_check.h"

namespace vsplat {
namespace {

constexpr long kWindow = 64;  // of cl/dense/scatter_rows.cl

}  // namespace

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
  ctx.launch({"scatter_rows", "scatter_keys", ""}, items(entries), {0, 12 * e}, index, weight, written(keys), E, R);
  const int bits = std::bit_width(static_cast<std::uint64_t>(rows));  // skipped entries have the key `rows`
  const Sorted sorted = radix_sort(ctx, std::move(keys), Tensor(), bits);
  ScatterPlan plan;
  plan.rows = rows;
  plan.from = sorted.values;
  plan.keys = sorted.keys;
  plan.weight = ctx.tensor({entries}, Type::f32, "scatter.weight");
  plan.starts = ctx.tensor({rows + 1}, Type::u32, "scatter.starts");
  ctx.launch({"scatter_rows", "scatter_plan", ""}, items(entries + 1), {0, 16 * e + 4.0 * static_cast<double>(rows)},
             plan.keys, plan.from, weight, written(plan.weight), written(plan.starts), E, R);
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
  const long windows = (entries + kWindow - 1) / kWindow;
  // As in check_tile_terms(): a longer loop over a row's windows could silently end early there.
  if (*tile_defines(ctx.device()) && windows > 65000)
    fail(Status::device, "scatter_rows: {} entries; on {}, which has no vectors, at most {} are possible", entries,
         ctx.device().name, 65000 * kWindow);
  const bool cpu = ctx.flavour() == Flavour::cpu;
  const long lanes = cpu ? 16 : 4, parts = c / lanes + c % lanes;
  const auto range = [&](long n) { return cpu ? groups(parts, 1, n) : groups((parts + 31) / 32, 32, n); };
  const char* defines = cpu ? "-DLANES=16" : "-DLANES=4";
  const double terms = static_cast<double>(entries) * static_cast<double>(c);
  const Tensor edges = ctx.tensor({windows, 2, c}, Type::f32, "scatter.edges");
  ctx.launch({"scatter_rows", "scatter_windows", defines}, range(windows),
             {2 * terms, 4 * terms + 2.0 * static_cast<double>(a.out.bytes())}, a.d, a.plan->from, a.plan->keys,
             a.plan->weight, a.plan->starts, written_somewhere(edges), written(a.out), static_cast<unsigned>(entries),
             static_cast<unsigned>(a.plan->rows), c, static_cast<unsigned>(a.first), static_cast<unsigned>(a.per_row),
             a.scale);
  ctx.launch({"scatter_rows", "scatter_edges", defines}, range(a.plan->rows), {0, static_cast<double>(edges.bytes())},
             a.plan->starts, edges, written(a.out), static_cast<unsigned>(a.plan->rows), c);
}

}  // namespace vsplat
