// The volume network's gradients against differences of the same network in double.
#include <gtest/gtest.h>

#include "model/networks/params/init.h"
#include "model/networks/vsplat/unet3d.h"
#include "tests/reference/volume_network.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat {
namespace {

const std::string kVolumeNetwork = "volume_network.";

struct Unet3dProblem {
  Config config;
  Weights weights;
  std::vector<float> in, dout;
  ref::VolumeNetwork reference;

  // micro's sizes otherwise. Norms are moved off 1 and 0.
  Unet3dProblem(int volume, const std::vector<int>& mult) : config(named_config("micro")) {
    config.volume = volume;
    config.volume_mult = mult;
    weights = initial_weights(config, 5);
    reference.config = config;
    for (const auto& [name, t] : std::map<std::string, HostTensor>(weights.all())) {
      HostTensor moved = t;
      const auto by = test::random_floats(t.data.size(), 17, -0.2f, 0.2f);
      for (std::size_t i = 0; i < by.size(); ++i) moved.data[i] += by[i];
      weights.set(name, moved);
      if (name.starts_with(kVolumeNetwork))
        reference.weights[name.substr(kVolumeNetwork.size())] = {moved.data.begin(), moved.data.end()};
    }
    const auto voxels = static_cast<std::size_t>(config.voxels()), ch = static_cast<std::size_t>(config.volume_ch);
    in = test::random_floats(voxels * 4 * ch, 1);
    dout = test::random_floats(voxels * ch, 2);
  }

  // Central difference of sum(dout out) from x, a weight or the input `volume`, in the direction `by`.
  double slope(std::vector<double>& x, const std::vector<double>& volume, const std::vector<float>& by) const {
    constexpr double h = 1e-5;
    double sums[2] = {0, 0};
    const std::vector<double> at = x;
    for (const int side : {0, 1}) {
      for (std::size_t i = 0; i < x.size(); ++i) x[i] = at[i] + (side ? h : -h) * static_cast<double>(by[i]);
      const ref::Volume out = reference.run(volume);
      for (std::size_t i = 0; i < dout.size(); ++i) sums[side] += out.x[i] * static_cast<double>(dout[i]);
    }
    x = at;
    return (sums[1] - sums[0]) / (2 * h);
  }

  // Along three directions each.
  void expect_gradient(const std::string& name, std::vector<double>& x, const std::vector<double>& volume,
                       const std::vector<float>& gradient) const {
    ASSERT_EQ(gradient.size(), x.size()) << name;
    double norm = 0;
    for (const float g : gradient) norm += static_cast<double>(g) * static_cast<double>(g);
    EXPECT_GT(norm, 0) << name;
    for (const std::uint32_t seed : {31u, 32u, 33u}) {
      const auto by = test::random_floats(x.size(), seed);
      double got = 0;
      for (std::size_t i = 0; i < by.size(); ++i) got += static_cast<double>(gradient[i]) * static_cast<double>(by[i]);
      EXPECT_NEAR(got, slope(x, volume, by), 1e-5 * std::sqrt(norm)) << name;
    }
  }
};

class VolumeBackward : public test::FlavourTest {
 protected:
  // The gradient by the input; those by the weights are in `learnt`.
  std::vector<float> run(const Unet3dProblem& p, const LearntWeights& learnt) {
    const VolumeNetwork network(ctx(), p.config, learnt);
    VolumeNetwork::Saved saved;
    const long voxels = p.config.voxels(), ch = p.config.volume_ch;
    const Tensor kept = network.forward(ctx(), ctx().upload({voxels, 4 * ch}, p.in), &saved);
    const std::vector<float> plain = ctx().read<float>(network.forward(ctx(), ctx().upload({voxels, 4 * ch}, p.in)));
    EXPECT_EQ(ctx().read<float>(kept), plain) << "saving changes nothing";
    return ctx().read<float>(network.backward(ctx(), std::move(saved), ctx().upload({voxels, ch}, p.dout)));
  }
};
VSPLAT_FLAVOURS(VolumeBackward);

TEST_P(VolumeBackward, AgreesWithDifferences) {
  for (const auto& [volume, mult] :
       {std::pair{6, std::vector<int>{1, 2}}, {3, std::vector<int>{1}}, {4, std::vector<int>{2, 1, 3}}}) {
    SCOPED_TRACE(volume);
    Unet3dProblem p(volume, mult);
    const LearntWeights learnt(ctx(), p.config, p.weights);
    std::vector<double> x(p.in.begin(), p.in.end());
    const std::vector<float> by_input = run(p, learnt);
    p.expect_gradient("input", x, x, by_input);
    for (auto& [name, weight] : p.reference.weights) {
      if (name.starts_with("conv_in.0.")) continue;  // belongs to lifting
      p.expect_gradient(name, weight, x, ctx().read<float>(learnt.at(kVolumeNetwork + name).gradient));
    }
  }
}

TEST_P(VolumeBackward, AddsToTheGradientsOfWeightsAndSaysTheSameTwice) {
  const Unet3dProblem p(4, {1, 2});
  const LearntWeights learnt(ctx(), p.config, p.weights), twice(ctx(), p.config, p.weights);
  const std::vector<float> by_input = run(p, learnt);
  EXPECT_EQ(run(p, twice), by_input);
  for (const std::string& name : learnt.names()) {
    const Tensor first = learnt.at(name).gradient;
    if (!first) continue;
    EXPECT_EQ(ctx().read<float>(twice.at(name).gradient), ctx().read<float>(first)) << name;
  }
  EXPECT_EQ(run(p, twice), by_input);
  for (const char* name : {"conv_out.weight", "down_blocks.0.downsample.conv.weight", "up_blocks.1.res.0.norm1.bias"}) {
    std::vector<float> want = ctx().read<float>(learnt.at(kVolumeNetwork + name).gradient);
    for (float& v : want) v *= 2;
    EXPECT_TRUE(test::close(ctx().read<float>(twice.at(kVolumeNetwork + name).gradient), want, 1e-6)) << name;
  }
}

TEST_P(VolumeBackward, GivesItsMemoryBackAndRunsInAPlan) {
  const Unet3dProblem p(4, {1, 2});
  const auto own = test::open_context(GetParam());
  const LearntWeights learnt(*own, p.config, p.weights);
  const VolumeNetwork network(*own, p.config, learnt);
  const long voxels = p.config.voxels(), ch = p.config.volume_ch;
  const auto plan = own->planner();
  for (Context* at : {plan.get(), own.get()}) {
    const std::size_t before = at->memory().live();
    VolumeNetwork::Saved saved;
    network.forward(*at, at->upload({voxels, 4 * ch}, p.in), &saved);
    EXPECT_EQ(network.backward(*at, std::move(saved), at->upload({voxels, ch}, p.dout)).shape(),
              (Shape{voxels, 4 * ch}));
    EXPECT_EQ(at->memory().live(), before);
  }
  EXPECT_EQ(own->memory().peak_live(), plan->memory().peak_live());
  VolumeNetwork::Saved saved;
  EXPECT_THROW(network.backward(*own, saved, own->tensor({voxels, 3})), Error);
}

}  // namespace
}  // namespace vsplat
