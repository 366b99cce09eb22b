// The backward of the encoder and of the modulation, against differences of a forward in double.
#include <functional>

#include "model/diagnose/selftest/reference/differences.h"
#include "model/diagnose/selftest/reference/plucker.h"
#include "model/networks/layers/vit.h"
#include "model/networks/params/init.h"
#include "model/networks/vsplat/pose_modulation.h"
#include "tests/reference/encoder.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using Row = std::vector<double>;

constexpr long kViews = 2;

// Positions are resampled (3 x 3 from 2 x 2), and parameters that begin as zeros and ones are changed.
struct Encoders {
  Config config = with_fields(named_config("micro"), {"image=12", "patch=4", "vit_depth=2", "vit_pos_grid=2"});
  Weights weights = initial_weights(config, 5);
  ref::Encoder reference{config, {}};

  Encoders() {
    for (const auto& [name, t] : std::map<std::string, HostTensor>(weights.all())) {
      HostTensor other = t;
      const auto more = test::random_floats(t.data.size(), static_cast<std::uint32_t>(name.size()), -0.2f, 0.2f);
      for (std::size_t i = 0; i < more.size(); ++i) other.data[i] += more[i];
      reference.weights[name] = Row(other.data.begin(), other.data.end());
      weights.set(name, other);
    }
  }

  std::vector<float> images() const {
    return test::random_floats(static_cast<std::size_t>(kViews * config.image * config.image * 3), 1, 0, 1);
  }
  std::vector<Camera> cameras() const {
    std::vector<Camera> out = test::ring(kViews);
    for (Camera& c : out) {
      c.width = c.height = config.image;
      c.fx = 14, c.fy = 15, c.cx = 6.5, c.cy = 5.5;
    }
    return out;
  }
};

const Encoders& model() {
  static const Encoders m;
  return m;
}

// Derivatives of sum(dy * f()) by each element of x, by central differences.
Row encoder_differences(Row& x, const std::vector<float>& dy, const std::function<Row()>& f) {
  return ref::central_differences(x, 1e-5, [&] { return ref::weighed(f(), dy); });
}

// Differences by every weight whose name begins with `prefix`.
std::map<std::string, Row> encoder_differences(const std::string& prefix, ref::Encoder encoder,
                                               const std::vector<float>& dy,
                                               const std::function<Row(const ref::Encoder&)>& f) {
  std::map<std::string, Row> out;
  for (auto& [name, values] : encoder.weights)
    if (name.rfind(prefix, 0) == 0) out[name] = encoder_differences(values, dy, [&] { return f(encoder); });
  return out;
}

class EncoderBackward : public test::FlavourTest {
 protected:
  EncoderBackward() : learnt_(ctx(), model().config, model().weights) {}

  static std::vector<float> dtokens() {
    const Config& c = model().config;
    return test::random_floats(static_cast<std::size_t>(kViews * (1 + c.tokens() * c.tokens()) * c.vit_dim), 2);
  }
  Tensor images() {
    const long s = model().config.image;
    return ctx().upload({kViews, s, s, 3}, model().images());
  }

  // Gradients accumulate: expects `times` the gradient. 1e-4 is the project's tolerance for a stage.
  void check(const std::map<std::string, Row>& want, double times) {
    ASSERT_FALSE(want.empty());
    for (auto [name, values] : want) {
      for (double& v : values) v *= times;
      EXPECT_TRUE(test::close(ctx().read<float>(learnt_.at(name).gradient), values, 2e-5)) << name;
    }
  }

  LearntWeights learnt_;
};
VSPLAT_FLAVOURS(EncoderBackward);

TEST_P(EncoderBackward, OfTheVitAgreesWithDifferences) {
  const Vit vit(ctx(), model().config.encoder_sizes(), learnt_);
  const auto forward = [](const ref::Encoder& e) { return e.tokens(model().images(), kViews); };
  static const std::map<std::string, Row> want =
      encoder_differences("encoder.model.", model().reference, dtokens(), forward);
  Vit::Saved saved;
  const Tensor tokens = vit.forward(ctx(), images(), &saved);
  EXPECT_TRUE(test::close(ctx().read<float>(tokens), forward(model().reference), 1e-5));
  EXPECT_TRUE(test::close(ctx().read<float>(vit.forward(ctx(), images())), forward(model().reference), 1e-5));
  const Tensor dy = ctx().upload(tokens.shape(), dtokens());
  vit.backward(ctx(), saved, dy);
  check(want, 1);
  vit.backward(ctx(), saved, dy);
  check(want, 2);
}

TEST_P(EncoderBackward, OfTheModulationAgreesWithDifferences) {
  const Config& config = model().config;
  const long t = config.tokens(), c = config.vit_dim;
  const PoseModulation modulation(ctx(), config, learnt_);
  Row rays;
  for (const Camera& camera : model().cameras())
    for (long y = 0; y < t; ++y)
      for (long x = 0; x < t; ++x) {
        Eigen::Vector3d direction, moment;
        const double p = config.patch;
        ref::plucker(camera, (static_cast<double>(x) + 0.5) * p, (static_cast<double>(y) + 0.5) * p, direction, moment);
        for (const Eigen::Vector3d& of : {direction, moment})
          for (const double v : ref::real_sh3(of)) rays.push_back(v);
      }
  const auto in = test::random_floats(dtokens().size(), 3, -2, 3);
  Row x(in.begin(), in.end());
  const auto dy = test::random_floats(static_cast<std::size_t>(kViews * t * t * c), 4);
  const auto forward = [&](const ref::Encoder& e) { return e.modulated(x, rays); };

  const Tensor tokens = ctx().upload({kViews, 1 + t * t, c}, in);
  const DeviceCameras cameras = upload_cameras(ctx(), model().cameras());
  PoseModulation::Saved saved;
  const Tensor features = modulation.forward(ctx(), tokens, cameras, &saved);
  const Row want = forward(model().reference);
  EXPECT_TRUE(test::close(ctx().read<float>(features), want, 1e-5));
  EXPECT_TRUE(test::close(ctx().read<float>(modulation.forward(ctx(), tokens, cameras)), want, 1e-5));
  const Tensor dfeatures = ctx().upload(features.shape(), dy);
  const Tensor dtokens = modulation.backward(ctx(), saved, dfeatures);
  EXPECT_TRUE(test::close(ctx().read<float>(dtokens),
                          encoder_differences(x, dy, [&] { return forward(model().reference); }), 2e-5));
  const auto by_weights = encoder_differences("dir_norm.", model().reference, dy, forward);
  check(by_weights, 1);
  modulation.backward(ctx(), saved, dfeatures);
  check(by_weights, 2);
}

TEST_P(EncoderBackward, IsDeterministic) {
  const Vit vit(ctx(), model().config.encoder_sizes(), learnt_);
  const PoseModulation modulation(ctx(), model().config, learnt_);
  const auto run = [&] {
    learnt_.zero_gradients(ctx());
    Vit::Saved encoded;
    PoseModulation::Saved modulated;
    const Tensor tokens = vit.forward(ctx(), images(), &encoded);
    const Tensor features = modulation.forward(ctx(), tokens, upload_cameras(ctx(), model().cameras()), &modulated);
    vit.backward(ctx(), encoded, modulation.backward(ctx(), modulated, features));
    std::vector<float> all;
    for (const std::string& name : learnt_.names())
      if (const Tensor& gradient = learnt_.at(name).gradient) {
        const auto values = ctx().read<float>(gradient);
        all.insert(all.end(), values.begin(), values.end());
      }
    return all;
  };
  EXPECT_EQ(run(), run());
}

// A plan runs the same code without launching anything, and counts what the run takes.
TEST_P(EncoderBackward, PlansItsMemory) {
  const auto own = test::open_context(GetParam());
  const LearntWeights learnt(*own, model().config, model().weights);
  const Vit vit(*own, model().config.encoder_sizes(), learnt);
  const PoseModulation modulation(*own, model().config, learnt);
  const DeviceCameras cameras = upload_cameras(*own, model().cameras());
  const long s = model().config.image;
  const Tensor pictures = own->upload({kViews, s, s, 3}, model().images());
  const auto run = [&](Context& on) {
    Vit::Saved encoded;
    PoseModulation::Saved modulated;
    const Tensor features = modulation.forward(on, vit.forward(on, pictures, &encoded), cameras, &modulated);
    vit.backward(on, encoded, modulation.backward(on, modulated, features));
    on.finish();
    return on.memory().peak_live();
  };
  const std::size_t planned = run(*own->planner());
  EXPECT_EQ(run(*own), planned);
}

TEST_P(EncoderBackward, WantsWeightsThatAreLearnt) {
  const Vit vit(ctx(), model().config.encoder_sizes(), model().weights);
  const PoseModulation modulation(ctx(), model().config, model().weights);
  Vit::Saved encoded;
  PoseModulation::Saved modulated;
  const Tensor tokens = vit.forward(ctx(), images(), &encoded);
  const Tensor features = modulation.forward(ctx(), tokens, upload_cameras(ctx(), model().cameras()), &modulated);
  EXPECT_THROW(vit.backward(ctx(), encoded, tokens), Error);
  EXPECT_THROW(modulation.backward(ctx(), modulated, features), Error);
}

}  // namespace
}  // namespace vsplat
