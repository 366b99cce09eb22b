// The fine stage's gradients, against differences of a forward in double along random directions.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include "model/diagnose/selftest/reference/differences.h"
#include "model/networks/params/params.h"
#include "model/networks/vsplat/voxel_refiner.h"
#include "tests/reference/refine.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

const std::string kVoxelNetwork = "voxel_network.";

// Random values; `share` of the voxels is selected.
ref::RefineCase make_case(const Config& config, float share) {
  ref::RefineCase in;
  in.config = config;
  in.cameras = test::orbit(3, config.image);
  const std::vector<float> lot = test::random_floats(static_cast<std::size_t>(config.voxels()), 1, 0, 1);
  for (std::size_t v = 0; v < lot.size(); ++v)
    if (lot[v] < share) in.index.push_back(static_cast<int>(v));
  const auto count = [](long a, long b) { return static_cast<std::size_t>(a * b); };
  in.volume = test::random_doubles(count(config.voxels(), config.volume_ch), 2);
  in.features = test::random_doubles(count(3L * config.tokens() * config.tokens(), config.vit_dim), 3);
  in.means = test::random_doubles(3 * in.index.size(), 4, -0.5f, 0.5f);
  std::uint32_t seed = 5;
  for (const Parameter& p : parameters(config)) {
    if (p.name.rfind(kVoxelNetwork, 0) != 0) continue;
    const long terms = p.shape.size() > 1 ? p.count() / p.shape[0] : 3;
    const float size = 1.7f / std::sqrt(static_cast<float>(terms));
    in.weights[p.name.substr(kVoxelNetwork.size())] =
        test::random_doubles(static_cast<std::size_t>(p.count()), seed++, -size, size);
  }
  return in;
}

// The weights that LearntWeights requires: all of the model's, with zeros for the other stages.
Weights all_weights(const ref::RefineCase& in) {
  Weights out;
  for (const Parameter& p : parameters(in.config)) {
    HostTensor t{p.shape, std::vector<float>(static_cast<std::size_t>(p.count()))};
    if (p.name.rfind(kVoxelNetwork, 0) == 0)
      t.data = test::as_floats(in.weights.at(p.name.substr(kVoxelNetwork.size())));
    out.set(p.name, std::move(t));
  }
  return out;
}

class RefinementBackward : public test::FlavourTest {
 protected:
  // Gradients start as `before` everywhere.
  void expect_derivative(const std::vector<std::string>& fields, float share, float before = 0) {
    SCOPED_TRACE(fmt::format("{} {}", fmt::join(fields, " "), share));
    ref::RefineCase in = make_case(with_fields(named_config("micro"), fields), share);
    const Config& config = in.config;
    const long p = static_cast<long>(in.rows());
    const LearntWeights weights(ctx(), config, all_weights(in));
    for (const auto& [name, values] : in.weights)
      ctx().write(weights.at(kVoxelNetwork + name).gradient, std::vector<float>(values.size(), before).data());
    const Refinement refinement(ctx(), config, weights);
    const DeviceCameras cameras = upload_cameras(ctx(), in.cameras);
    const long t = config.tokens(), views = cameras.count();
    Refinement::Input input{ctx().upload({config.voxels(), config.volume_ch}, test::as_floats(in.volume)),
                            ctx().upload({views, t, t, config.vit_dim}, test::as_floats(in.features)), &cameras,
                            ctx().upload({p, 3}, test::as_floats(in.means)), ctx().upload({p}, in.index, Type::i32)};
    Refinement::Saved saved;
    const std::vector<float> refined = ctx().read<float>(refinement.forward(ctx(), input, &saved).refined);
    EXPECT_EQ(refined, ctx().read<float>(refinement.forward(ctx(), input).refined)) << "saving changes it";
    if (p > 0) {
      EXPECT_TRUE(test::close(refined, ref::refine(in), 1e-5));
    }

    const std::vector<float> drefined = test::random_floats(refined.size(), 99);
    const auto gradient = [&](const Tensor& of) {
      return ctx().upload(of.shape(), std::vector<float>(static_cast<std::size_t>(of.count()), before));
    };
    const Refinement::Gradients d{gradient(input.volume), gradient(input.features), gradient(input.means)};
    refinement.backward(ctx(), saved, ctx().upload({p, config.fine_dim}, drefined), d);

    // Compares the derivative along a random direction with the gradient.
    std::uint32_t seed = 100;
    const auto compare = [&](const std::string& name, std::vector<double>& x, const Tensor& got) {
      const std::vector<float> g = ctx().read<float>(got);
      const std::vector<double> at = x, along = test::random_doubles(x.size(), seed++);
      double derivative = 0, scale = 0;
      for (std::size_t i = 0; i < x.size(); ++i) {
        const double term = (static_cast<double>(g[i]) - before) * along[i];
        derivative += term;
        scale += term * term;
      }
      const auto loss = [&](double step) {
        for (std::size_t i = 0; i < x.size(); ++i) x[i] = at[i] + step * along[i];
        return p == 0 ? 0.0 : ref::weighed(ref::refine(in), drefined);
      };
      const double want = (loss(1e-6) - loss(-1e-6)) / 2e-6;
      x = at;
      // The terms have independent errors of about 1e-5 each.
      EXPECT_NEAR(derivative, want, 1e-4 * std::sqrt(scale)) << name;
      const bool has_one = p > 0 && (config.use_projected || name != "features");
      EXPECT_EQ(scale > 0, has_one) << name;
    };
    compare("volume", in.volume, d.volume);
    compare("features", in.features, d.features);
    compare("means", in.means, d.means);
    for (auto& [name, values] : in.weights) compare(name, values, weights.at(kVoxelNetwork + name).gradient);
  }
};
VSPLAT_FLAVOURS(RefinementBackward);

TEST_P(RefinementBackward, IsTheDerivative) {
  expect_derivative({}, 0.4f);
  expect_derivative({}, 0.1f);
}

TEST_P(RefinementBackward, EveryVariantIsTheDerivative) {
  expect_derivative({"use_projected=false"}, 0.4f);
  expect_derivative({"refine_out_kernel=3"}, 0.4f);
  expect_derivative({"view_weight=distance", "sample_half_pixel=false"}, 0.4f);
  expect_derivative({"voxel_levels=2", "fine_dim=17", "volume=6"}, 0.4f);
}

TEST_P(RefinementBackward, AddsToWhatIsThere) { expect_derivative({}, 0.4f, 0.5f); }

TEST_P(RefinementBackward, NoVoxelSelectedAddsNothing) { expect_derivative({}, 0.0f); }

TEST_P(RefinementBackward, PlanTakesTheSameMemory) {
  const ref::RefineCase in = make_case(named_config("micro"), 0.4f);
  const auto own = test::open_context(GetParam());
  const auto planner = own->planner();
  const auto run = [&](Context& on) {
    const Config& config = in.config;
    const long p = static_cast<long>(in.rows()), t = config.tokens();
    const LearntWeights weights(on, config, all_weights(in));
    const Refinement refinement(on, config, weights);
    const DeviceCameras cameras = upload_cameras(on, in.cameras);
    const Refinement::Input input{on.upload({config.voxels(), config.volume_ch}, test::as_floats(in.volume)),
                                  on.upload({3, t, t, config.vit_dim}, test::as_floats(in.features)), &cameras,
                                  on.upload({p, 3}, test::as_floats(in.means)), on.upload({p}, in.index, Type::i32)};
    Refinement::Saved saved;
    refinement.forward(on, input, &saved);
    const Tensor drefined = on.tensor({p, config.fine_dim});
    on.fill_zero(drefined);
    const Refinement::Gradients d{on.tensor(input.volume.shape()), on.tensor(input.features.shape()),
                                  on.tensor(input.means.shape())};
    for (const Tensor& zero : {d.volume, d.features, d.means}) on.fill_zero(zero);
    refinement.backward(on, saved, drefined, d);
    return on.memory().peak_live();
  };
  EXPECT_EQ(run(*planner), run(*own));
}

}  // namespace
}  // namespace vsplat
