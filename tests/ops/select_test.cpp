#include "model/ops/select.h"

#include "model/ops/compact.h"
#include "model/rng.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

using test::close;

double logistic(double x) { return 1 / (1 + std::exp(-x)); }

struct Chosen {
  std::vector<double> factor, refined;
  std::vector<std::uint32_t> flags;
};

Chosen reference(const std::string& selection, const std::vector<float>& logits, const std::vector<float>& noise,
                 const std::vector<float>& opacities, double temperature, double threshold) {
  Chosen out;
  for (std::size_t i = 0; i < logits.size(); ++i) {
    const double x = logits[i], opacity = opacities[i];
    double factor = 1;
    bool flag = opacity > threshold;
    if (selection == "gumbel")
      factor = logistic((x + (noise.empty() ? 0.0 : noise[i])) / temperature), flag = factor > 0.5;
    if (selection == "sigmoid") factor = logistic(x), flag = factor > 0.5;
    if (selection == "ste") flag = logistic(x) > 0.5, factor = flag ? 1 : 0;
    out.factor.push_back(factor);
    out.refined.push_back(opacity * factor);
    out.flags.push_back(flag ? 1 : 0);
  }
  return out;
}

void check(const std::string& selection, std::size_t n, bool noisy) {
  Context& ctx = test::context(Flavour::cpu);
  const std::vector<float> logits = test::random_floats(n, 51), opacities = test::random_floats(n, 52, 0.0f, 1.0f);
  const std::vector<float> noise = noisy ? test::random_floats(n, 53, -2.0f, 2.0f) : std::vector<float>{};
  const long count = static_cast<long>(n);
  SelectForward a;
  a.logits = ctx.upload({count}, logits);
  if (noisy) a.noise = ctx.upload({count}, noise);
  a.opacities = ctx.upload({count}, opacities);
  a.selection = selection_of(selection);
  a.temperature = 0.3f;
  a.opacity_threshold = 0.4f;
  a.factor = ctx.upload({count}, test::nans(n));
  a.refined = ctx.upload({count}, test::nans(n));
  a.flags = ctx.upload({count}, std::vector<std::uint32_t>(n, 7), Type::u32);
  select_forward(ctx, a);
  const Chosen want = reference(selection, logits, noise, opacities, 0.3, 0.4);
  EXPECT_TRUE(close(ctx.read<float>(a.factor), want.factor, 1e-6, true)) << selection;
  EXPECT_TRUE(close(ctx.read<float>(a.refined), want.refined, 1e-6, true)) << selection;
  EXPECT_EQ(ctx.read<std::uint32_t>(a.flags), want.flags) << selection;

  std::vector<int> indices;
  for (std::size_t i = 0; i < n; ++i) {
    if (want.flags[i]) indices.push_back(static_cast<int>(i));
  }
  EXPECT_EQ(ctx.read<int>(compact(ctx, a.flags, 0)), indices) << selection;
}

TEST(Select, EveryVariantMatchesReferenceAndCompactsInOrder) {
  for (const std::size_t n : {1, 3, 63, 64, 65, 1009, 4099}) {
    check("gumbel", n, false);
    check("gumbel", n, true);
    check("sigmoid", n, true);
    check("ste", n, false);
    check("opacity", n, true);
  }
}

TEST(Select, NoneAndAllSelected) {
  Context& ctx = test::context(Flavour::cpu);
  const Tensor none = ctx.upload({5}, std::vector<std::uint32_t>(5, 0), Type::u32);
  EXPECT_EQ(compact(ctx, none, 3).dim(0), 0);
  const Tensor all = ctx.upload({5}, std::vector<std::uint32_t>(5, 1), Type::u32);
  EXPECT_EQ(ctx.read<int>(compact(ctx, all, 3)), (std::vector<int>{0, 1, 2, 3, 4}));
  EXPECT_EQ(compact(ctx, ctx.tensor({0}, Type::u32), 3).dim(0), 0);
}

// The device's Philox is the host's, and the noise is the logistic variable of its uniform numbers.
TEST(Select, NoiseIsTheHostsAndLogistic) {
  Context& ctx = test::context(Flavour::cpu);
  const long n = 20001;
  const std::uint64_t seed = 0x123456789abcdefULL;
  const Tensor noise = ctx.upload({n}, test::nans(n));
  logistic_noise(ctx, noise, seed, 7, 3);
  std::vector<double> want;
  double sum = 0, squares = 0;
  for (long i = 0; i < n; ++i) {
    const double u = uniform_open(philox4x32_10({static_cast<std::uint32_t>(i), 7, 3, 0}, rng_key(seed))[0]);
    want.push_back(std::log(u) - std::log(1 - u));
    sum += want.back();
    squares += want.back() * want.back();
  }
  EXPECT_TRUE(close(ctx.read<float>(noise), want, 1e-6));
  EXPECT_NEAR(sum / n, 0, 0.05);
  EXPECT_NEAR(squares / n, M_PI * M_PI / 3, 0.1);
}

TEST(Select, RejectsBadShapeAndValues) {
  Context& ctx = test::context(Flavour::cpu);
  SelectForward a;
  a.logits = a.opacities = a.factor = a.refined = ctx.tensor({4});
  a.flags = ctx.tensor({4});
  EXPECT_THROW(select_forward(ctx, a), Error);  // flags are not u32
  a.flags = ctx.tensor({4}, Type::u32);
  a.temperature = 0;
  EXPECT_THROW(select_forward(ctx, a), Error);
  EXPECT_THROW(selection_of("best"), Error);
}

}  // namespace
}  // namespace vsplat
