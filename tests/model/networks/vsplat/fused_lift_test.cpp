// Lifting's gradients, for the loss sum(dout out), against its definition in double.
#include "model/networks/vsplat/fused_lift.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "model/diagnose/selftest/reference/lift.h"
#include "model/networks/params/init.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/orbit.h"

namespace vsplat {
namespace {

const std::string kConvIn = "volume_network.conv_in.0.";

struct LiftProblem {
  Config config;
  Weights weights;
  std::vector<Camera> cameras;
  std::vector<float> features, dout, before;

  LiftProblem(int volume, int views, double radius) : config(named_config("micro")) {
    config.volume = volume, config.volume_mult = {1};
    weights = initial_weights(config, 5);
    cameras = test::orbit(views, config.image, radius);
    const auto t = static_cast<std::size_t>(config.tokens()), c = static_cast<std::size_t>(config.vit_dim);
    features = test::random_floats(static_cast<std::size_t>(views) * t * t * c, 1, -1.0f, 2.0f);
    before = test::random_floats(features.size(), 3);
    dout = test::random_floats(static_cast<std::size_t>(config.voxels() * 4 * config.volume_ch), 2);
  }
};

struct Gradients {
  std::vector<double> features, weight, bias;
};

// out = W_mean mean + W_variance variance + bias, for each voxel.
Gradients reference(const LiftProblem& p) {
  const auto c = static_cast<std::size_t>(p.config.vit_dim), wide = 4 * static_cast<std::size_t>(p.config.volume_ch);
  const auto voxels = static_cast<std::size_t>(p.config.voxels());
  const std::vector<float>& w = p.weights.at(kConvIn + "weight").data;
  const ref::Lifted lifted =
      ref::lift(p.features, p.config.tokens(), p.config.vit_dim, p.cameras, p.config.image, true, p.config.volume);
  Gradients g{{}, std::vector<double>(w.size()), std::vector<double>(wide)};
  std::vector<float> dmean, dvariance;
  for (std::size_t i = 0; i < voxels; ++i) {
    std::vector<double> back(2 * c);
    for (std::size_t j = 0; j < wide; ++j) {
      const double d = p.dout[i * wide + j];
      g.bias[j] += d;
      for (std::size_t k = 0; k < c; ++k) {
        g.weight[j * 2 * c + k] += d * lifted.mean[i * c + k];
        g.weight[j * 2 * c + c + k] += d * lifted.variance[i * c + k];
      }
      for (std::size_t k = 0; k < 2 * c; ++k) back[k] += d * static_cast<double>(w[j * 2 * c + k]);
    }
    for (std::size_t k = 0; k < c; ++k) {
      dmean.push_back(static_cast<float>(back[k]));
      dvariance.push_back(static_cast<float>(back[c + k]));
    }
  }
  g.features = ref::lift_gradient(p.features, p.config.tokens(), p.config.vit_dim, p.cameras, p.config.image, true,
                                  p.config.volume, dmean, dvariance);
  for (std::size_t i = 0; i < p.before.size(); ++i) g.features[i] += static_cast<double>(p.before[i]);
  return g;
}

class LiftingBackward : public test::FlavourTest {
 protected:
  // The gradient by the features, added to `before`; those by weight and bias are in `learnt`.
  static std::vector<float> run(Context& on, const LiftProblem& p, const LearntWeights& learnt) {
    const Lifting lifting(on, p.config, learnt);
    const long v = static_cast<long>(p.cameras.size()), t = p.config.tokens(), c = p.config.vit_dim;
    const Tensor features = on.upload({v, t, t, c}, p.features), dfeatures = on.upload({v, t, t, c}, p.before);
    Lifting::Saved saved;
    lifting.forward(on, features, upload_cameras(on, p.cameras), &saved);
    lifting.backward(on, saved, on.upload({p.config.voxels(), 4L * p.config.volume_ch}, p.dout), dfeatures);
    return on.planning() ? std::vector<float>() : on.read<float>(dfeatures);
  }
};
VSPLAT_FLAVOURS(LiftingBackward);

// The largest case takes more than one block of voxels; one camera is inside the cube, with voxels behind it.
TEST_P(LiftingBackward, MatchesReference) {
  for (const auto& [volume, views, radius] :
       {std::tuple{4, 2, 1.6}, {2, 1, 1.6}, {5, 4, 0.8}, {6, 3, 0.3}, {22, 3, 1.6}}) {
    SCOPED_TRACE(fmt::format("{}^3, {} views", volume, views));
    const LiftProblem p(volume, views, radius);
    const LearntWeights learnt(ctx(), p.config, p.weights);
    const Gradients want = reference(p);
    const auto features = run(ctx(), p, learnt);
    const auto gradient = [&](const char* name) { return ctx().read<float>(learnt.at(kConvIn + name).gradient); };
    EXPECT_TRUE(test::close_by_channel(features, want.features, static_cast<std::size_t>(p.config.vit_dim), 1e-5));
    EXPECT_TRUE(test::close(gradient("weight"), want.weight, 1e-5));
    EXPECT_TRUE(test::close(gradient("bias"), want.bias, 1e-5));

    const LearntWeights twice(ctx(), p.config, p.weights);
    EXPECT_EQ(run(ctx(), p, twice), features) << "the same bits";
    EXPECT_EQ(ctx().read<float>(twice.at(kConvIn + "weight").gradient), gradient("weight"));
    run(ctx(), p, twice);
    std::vector<double> both = want.weight;
    for (double& v : both) v *= 2;
    EXPECT_TRUE(test::close(ctx().read<float>(twice.at(kConvIn + "weight").gradient), both, 1e-5)) << "added to";
  }
}

TEST_P(LiftingBackward, GivesItsMemoryBackAndRunsInAPlan) {
  const LiftProblem p(4, 2, 1.6);
  const auto own = test::open_context(GetParam());
  const LearntWeights learnt(*own, p.config, p.weights);
  const auto plan = own->planner();
  for (Context* at : {plan.get(), own.get()}) {
    const std::size_t before = at->memory().live();
    run(*at, p, learnt);
    EXPECT_EQ(at->memory().live(), before);
  }
  EXPECT_EQ(own->memory().peak_live(), plan->memory().peak_live());
}

TEST_P(LiftingBackward, RejectsBadShape) {
  const LiftProblem p(4, 2, 1.6);
  const LearntWeights learnt(ctx(), p.config, p.weights);
  const Lifting lifting(ctx(), p.config, learnt);
  const Tensor features = ctx().upload({2, 2, 2, 12}, p.features);
  const Lifting::Saved saved{features, upload_cameras(ctx(), p.cameras)};
  EXPECT_THROW(lifting.backward(ctx(), saved, ctx().tensor({64, 15}), features), Error);
}

}  // namespace
}  // namespace vsplat
