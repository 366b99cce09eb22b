#include "runtime/gemm.h"

#include <memory>

#include "bench/bench.h"
#include "bench/case_data.h"
#include "bench/ops/operation.h"
#include "bench/references.h"
#include "bench/shapes.h"
#include "runtime/gemm_matrix.h"

namespace vsplat::bench {

namespace {

// One case's data on both sides.
struct Data {
  GemmShape shape;
  std::vector<float> x0, x1, scale, shift, w, bias, residual;
  std::vector<int> map;
  PackedMatrix b;
  Gemm g;

  long channels() const { return shape.c0 + shape.c1; }
  long taps() const { return shape.taps ? shape.taps : 1; }
  long k() const { return taps() * channels(); }

  double a(long row, long c) const {
    double v = c < shape.c0 ? x0[static_cast<std::size_t>(row * shape.c0 + c)]
                            : x1[static_cast<std::size_t>(row * shape.c1 + c - shape.c0)];
    if (!shape.prologue) return v;
    v = v * scale[static_cast<std::size_t>(c)] + shift[static_cast<std::size_t>(c)];
    return v / (1 + std::exp(-v));
  }

  // Without bias, activation and residual.
  double product(long i) const {
    const long m = i / shape.n, n = i % shape.n;
    double sum = 0;
    for (long t = 0; t < taps(); ++t) {
      const long row = map.empty() ? m : map[static_cast<std::size_t>(m * taps() + t)];
      if (row < 0) continue;
      for (long c = 0; c < channels(); ++c)
        sum += a(row, c) * static_cast<double>(w[static_cast<std::size_t>(n * k() + t * channels() + c)]);
    }
    return sum;
  }

  double want(long i) const {
    double sum = product(i) + static_cast<double>(bias[static_cast<std::size_t>(i % shape.n)]);
    if (shape.activation == Activation::gelu) sum = 0.5 * sum * (1 + std::erf(sum / std::sqrt(2.0)));
    if (shape.activation == Activation::silu) sum = sum / (1 + std::exp(-sum));
    return residual.empty() ? sum : sum + static_cast<double>(residual[static_cast<std::size_t>(i)]);
  }
};

// Neighbours of a sheet of voxels: close by in memory, two in five absent, as where a tenth of a volume is selected.
std::vector<int> sheet_map(long m, long taps) {
  std::vector<int> map;
  std::mt19937 engine(1);
  for (long i = 0; i < m; ++i)
    for (long t = 0; t < taps; ++t) {
      const long near = i + (t - taps / 2) * 7;
      const bool absent = t != taps / 2 && engine() % 5 < 2;
      map.push_back(absent || near < 0 || near >= m ? -1 : static_cast<int>(near));
    }
  return map;
}

std::shared_ptr<Data> make_data(Context& ctx, const GemmShape& s) {
  auto d = std::make_shared<Data>();
  d->shape = s;
  d->x0 = random_floats(s.m * s.c0, 1);
  d->x1 = random_floats(s.m * s.c1, 2);
  d->w = random_floats(s.n * d->k(), 3);
  d->bias = random_floats(s.n, 4);
  Gemm& g = d->g;
  if (s.prologue) {
    d->scale = random_floats(d->channels(), 5, 0.5f, 2.0f);
    d->shift = random_floats(d->channels(), 6);
    g.a.scale = ctx.upload({d->channels()}, d->scale);
    g.a.shift = ctx.upload({d->channels()}, d->shift);
    g.a.silu = true;
  }
  if (s.taps) {
    d->map = sheet_map(s.m, s.taps);
    g.a.map = ctx.upload({s.m, s.taps}, d->map, Type::i32);
  }
  if (s.residual) {
    d->residual = random_floats(s.m * s.n, 7);
    g.residual = ctx.upload({s.m, s.n}, d->residual);
  }
  g.a.x0 = ctx.upload({s.m, s.c0}, d->x0);
  if (s.c1) g.a.x1 = ctx.upload({s.m, s.c1}, d->x1);
  d->b = pack_matrix(ctx, d->w.data(), d->k(), s.n, 1, d->k(), "B");
  g.b = &d->b;
  g.bias = ctx.upload({s.n}, d->bias);
  g.activation = s.activation;
  g.out = ctx.tensor({s.m, s.n});
  return d;
}

// The same product by CLBlast, in a context of its own that is opened at the first run.
std::function<void()> by_clblast(const Context& ctx, const GemmShape& s) {
  struct Other {
    std::unique_ptr<Context> ctx;
    std::shared_ptr<Data> data;
  };
  ContextOptions options;
  options.device = std::to_string(ctx.device().index);
  options.kernels = name_of(ctx.flavour());
  options.gemm = GemmChoice::clblast;
  return [options, s, other = std::make_shared<Other>()] {
    if (!other->ctx) {
      other->ctx = std::make_unique<Context>(options);
      other->data = make_data(*other->ctx, s);
    }
    gemm(*other->ctx, other->data->g);
    other->ctx->finish();
  };
}

// A as other libraries take it: composed, row by row.
std::vector<float> composed(const Data& d) {
  const auto width = static_cast<std::size_t>(d.channels());
  const long rows = d.shape.m;
  std::vector<float> sources;
  for (long row = 0; row < rows; ++row)
    for (long c = 0; c < d.channels(); ++c) sources.push_back(static_cast<float>(d.a(row, c)));
  if (d.map.empty()) return sources;
  std::vector<float> out(d.map.size() * width, 0.0f);
  for (std::size_t i = 0; i < d.map.size(); ++i)
    if (d.map[i] >= 0) std::copy_n(&sources[static_cast<std::size_t>(d.map[i]) * width], width, &out[i * width]);
  return out;
}

Prepared prepare(Context& ctx, const GemmShape& s, bool references) {
  const auto d = make_data(ctx, s);
  Prepared p;
  const double m = static_cast<double>(s.m), n = static_cast<double>(s.n), k = static_cast<double>(d->k());
  p.cost = {2 * m * n * k, 4 * (m * static_cast<double>(d->channels()) + n * k + m * n * (s.residual ? 2 : 1))};
  p.kind = s.n == 1 ? Kind::memory : Kind::compute;
  if (d->b.pairs || (ctx.flavour() == Flavour::gpu && wants_matrix(ctx, s.m, s.n, d->k()))) p.tolerance = 8e-3;
  p.run = [&ctx, d] { gemm(ctx, d->g); };
  p.error = [&ctx, d] {
    const auto got = ctx.read<float>(d->g.out);
    return worst_error(
        d->shape.m * d->shape.n, 300, [&](long i) { return got[static_cast<std::size_t>(i)]; },
        [&](long i) { return d->want(i); });
  };
  if (!s.c1 && !s.taps && !s.prologue) p.references["CLBlast"] = {by_clblast(ctx, s), {}};
  if (references)
    References::add_product(ctx, p, [&] {
      return References::Product{s.m,
                                 s.n,
                                 d->k(),
                                 composed(*d),
                                 d->w,
                                 d->bias,
                                 d->residual,
                                 s.activation,
                                 [d](long i) { return d->want(i); },
                                 [d](long i) { return d->product(i); }};
    });
  return p;
}

}  // namespace

std::vector<Case> gemm_cases(const Options& options) {
  std::vector<Case> cases;
  cases.reserve(kGemmShapes.size() + 1);
  for (const GemmShape& s : kGemmShapes)
    cases.push_back(
        {s.name, [s, references = options.references](Context& ctx) { return prepare(ctx, s, references); }});
  cases.push_back(
      {"encoder.fc1 backward weights", [](Context& ctx) {
         TransposedGemm g;
         g.a = random(ctx, {4100, 3072}, 1), g.b = random(ctx, {4100, kDim}, 2), g.out = ctx.tensor({3072, kDim});
         return operation(ctx, [&ctx, g] { transposed_gemm(ctx, g); }, {g.out});
       }});
  return cases;
}

}  // namespace vsplat::bench
