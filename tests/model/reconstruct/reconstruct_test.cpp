// Reconstruction from views and a cube to a scene in the user's frame: against the specification's Gaussians, and with
// the whole rig moved.
#include "model/reconstruct/reconstruct.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>

#include "model/base/merged_gaussians.h"
#include "model/base/scene_edit.h"
#include "model/metrics/metrics.h"
#include "model/reconstruct/inputs_fit.h"
#include "model/render/render.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/golden_inputs.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::Golden;

// The golden views, moved from the object's frame to a world by `motion`.
std::vector<PreparedView> golden_views(const Golden& golden, const Similarity& motion) {
  const int edge = golden.config().image;
  const std::vector<float> images = golden.floats("input.images");
  const std::size_t pixels = static_cast<std::size_t>(edge) * edge * 3;
  std::vector<PreparedView> out;
  for (const Camera& camera : test::golden_cameras(golden)) {
    PreparedView view{Image(edge, edge, 3), camera};
    const auto from = images.begin() + static_cast<std::ptrdiff_t>(pixels * out.size());
    view.image.data.assign(from, from + static_cast<std::ptrdiff_t>(pixels));
    view.camera = to_frame(camera, motion.inverse());
    out.push_back(view);
  }
  return out;
}

Similarity some_motion() {
  Similarity motion;
  motion.scale = 2.3;
  motion.rotation = Eigen::AngleAxisd(2.1, Eigen::Vector3d(0.3, -1, 0.5).normalized()).toRotationMatrix();
  motion.translation = {4, -2, 1.5};
  return motion;
}

class Reconstruct : public test::FlavourTest {};
VSPLAT_FLAVOURS(Reconstruct);

TEST_P(Reconstruct, GivesTheSpecificationsGaussians) {
  const Golden golden = Golden::load("micro");
  const auto network = make_network(ctx(), golden.config(), golden.weights());
  const Reconstruction got = reconstruct(ctx(), *network, golden_views(golden, {}), {}, {});
  EXPECT_TRUE(test::close(got.scene.gaussians.means, golden.floats("stage.final.means"), 1e-4));
  EXPECT_TRUE(test::close(got.scene.gaussians.scales, golden.floats("stage.final.scales"), 1e-4));
  EXPECT_TRUE(test::close(got.scene.gaussians.opacities, golden.floats("stage.final.opacities"), 1e-4));
  EXPECT_TRUE(test::close_by_channel(got.scene.gaussians.sh, golden.floats("stage.final.sh"),
                                     3 * got.scene.gaussians.sh_count(), 1e-4));
  EXPECT_FLOAT_EQ(got.scene.near, 0.2f);
  EXPECT_FALSE(got.scene.mirror);
}

TEST_P(Reconstruct, FollowsAMotionOfTheWholeRigAndNothingElse) {
  const Golden golden = Golden::load("micro");
  for (const char* rebase : {"rotate", "move"}) {
    Config config = golden.config();
    config.rebase = rebase;
    config.negate_camera_centre = true;
    const auto network = make_network(ctx(), config, golden.weights());
    const Similarity motion = some_motion();
    const Reconstruction here = reconstruct(ctx(), *network, golden_views(golden, {}), {}, {});
    const Reconstruction there =
        reconstruct(ctx(), *network, golden_views(golden, motion), {motion.translation, motion.scale}, {});
    EXPECT_EQ(here.selected, there.selected);
    EXPECT_NEAR(there.scene.near, 0.2 * motion.scale, 1e-6);
    ASSERT_TRUE(here.scene.mirror && there.scene.mirror);
    for (const Camera& camera : test::golden_cameras(golden)) {
      const auto picture = [&](const Scene& scene, const Camera& from) {
        RenderOptions options;
        options.near = scene.near;
        options.mirror = scene.mirror;
        return render_picture(ctx(), upload(ctx(), scene.gaussians), from, options).colour;
      };
      const double agreement =
          psnr(picture(here.scene, camera), picture(there.scene, to_frame(camera, motion.inverse())));
      EXPECT_GE(agreement, 60) << rebase;
    }
  }
}

// Each pass as by hand: other views first, and all in one world.
TEST_P(Reconstruct, JoinsPassesWithOtherReferences) {
  const Golden golden = Golden::load("micro");
  const auto network = make_network(ctx(), golden.config(), golden.weights());
  const std::vector<PreparedView> views = golden_views(golden, some_motion());
  const Placement placement{some_motion().translation, some_motion().scale};
  ASSERT_EQ(views.size(), 2U);
  const Reconstruction one = reconstruct(ctx(), *network, views, placement, {}),
                       other = reconstruct(ctx(), *network, {views[1], views[0]}, placement, {});
  ASSERT_NE(one.scene.gaussians.means, other.scene.gaussians.means);
  const Gaussians expected = mean_of({one.scene.gaussians, other.scene.gaussians});
  ReconstructOptions options;
  std::vector<double> shares;
  options.forward.progress = [&](const std::string&, double done) { shares.push_back(done); };
  for (const int passes : {2, 16}) {  // no more than there are views
    options.passes = passes;
    shares.clear();
    const Reconstruction got = reconstruct(ctx(), *network, views, placement, options);
    EXPECT_EQ(got.selected, one.selected);
    ASSERT_EQ(got.scene.gaussians.count, expected.count);
    EXPECT_TRUE(test::close(got.scene.gaussians.means, expected.means, 1e-5));
    EXPECT_TRUE(test::close(got.scene.gaussians.scales, expected.scales, 1e-5));
    EXPECT_TRUE(test::close(got.scene.gaussians.opacities, expected.opacities, 1e-5));
    EXPECT_TRUE(test::close(got.scene.gaussians.sh, expected.sh, 1e-4));
    EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
    EXPECT_LE(shares.back(), 1);
    const std::size_t each = shares.size() / 2;
    for (std::size_t i = 0; i < each; ++i) EXPECT_NEAR(shares[each + i], 0.5 + shares[i], 1e-12);
  }
}

// In the frame of the first view, without what is left faint.
TEST_P(Reconstruct, MergesWhatSharesACell) {
  const Golden golden = Golden::load("micro");
  const auto network = make_network(ctx(), golden.config(), golden.weights());
  const std::vector<PreparedView> views = golden_views(golden, {});  // the object's frame is the world
  ReconstructOptions options;
  options.passes = 2;
  const Gaussians all = reconstruct(ctx(), *network, views, {}, options).scene.gaussians;
  for (const double cell : {0.5, 1.0}) {
    Gaussians expected = merged_in_cells(all, cell / golden.config().volume);
    keep(expected, [&](std::size_t k) { return expected.opacities[k] >= 0.02f; });
    options.merge_cell = cell;
    const Gaussians got = reconstruct(ctx(), *network, views, {}, options).scene.gaussians;
    EXPECT_LT(got.count, all.count);
    ASSERT_EQ(got.count, expected.count);
    EXPECT_TRUE(test::close(got.means, expected.means, 1e-4));
    EXPECT_TRUE(test::close(got.opacities, expected.opacities, 1e-4));
  }
}

// In the frame of the first view.
TEST_P(Reconstruct, FitsTheResultToTheInputs) {
  const Golden golden = Golden::load("micro");
  Config config = golden.config();
  config.fit_epochs = 2;
  const auto network = make_network(ctx(), config, golden.weights());
  const std::vector<PreparedView> views = golden_views(golden, {});
  std::vector<Camera> cameras;
  cameras.reserve(views.size());
  for (const PreparedView& view : views) cameras.push_back(view.camera);
  const PlacedViews placed = place_views(cameras, {}, config.rebase);
  ReconstructOptions options;
  std::vector<std::pair<std::string, double>> stages;
  options.forward.progress = [&](const std::string& stage, double done) { stages.emplace_back(stage, done); };
  for (const int epochs : {3, 2, 0}) {
    options.fit_epochs = 0;
    Gaussians expected = reconstruct(ctx(), *network, views, {}, options).scene.gaussians;
    transform(expected, placed.to_world.inverse());
    std::vector<FitPicture> pictures;
    for (std::size_t i = 0; i < views.size(); ++i)
      pictures.push_back(fit_picture(views[i].image, {}, false, placed.cameras[i]));
    expected = fitted_to_inputs(ctx(), expected, pictures, {epochs, network->drawing().mirror, {}});
    transform(expected, placed.to_world);
    options.fit_epochs = epochs;
    if (epochs == config.fit_epochs) options.fit_epochs.reset();  // the model's
    stages.clear();
    const Gaussians got = reconstruct(ctx(), *network, views, {}, options).scene.gaussians;
    ASSERT_EQ(got.count, expected.count);
    EXPECT_TRUE(test::close(got.means, expected.means, 1e-3));
    EXPECT_TRUE(test::close(got.sh, expected.sh, 1e-2));
    EXPECT_EQ(std::count_if(stages.begin(), stages.end(), [](const auto& s) { return s.first == "fit"; }), epochs);
    EXPECT_TRUE(
        std::is_sorted(stages.begin(), stages.end(), [](const auto& a, const auto& b) { return a.second < b.second; }));
  }
  const test::TemporaryFolder folder;
  options.dump = folder / "dump";

  EXPECT_NO_THROW(reconstruct(ctx(), *network, views, {}, options));  // of the network alone
  options.fit_epochs = 2;
  EXPECT_THROW(reconstruct(ctx(), *network, views, {}, options), Error);
}

TEST_P(Reconstruct, TakesPassesFromTheModelAndRefusesThemWhereThereCanBeOne) {
  const Golden golden = Golden::load("micro");
  Config config = golden.config();
  config.passes = 2;
  config.merge_cell = 1;
  const auto network = make_network(ctx(), config, golden.weights());
  const std::vector<PreparedView> views = golden_views(golden, {});
  ReconstructOptions options;
  options.passes = 2, options.merge_cell = 1;
  const Reconstruction by_model = reconstruct(ctx(), *network, views, {}, {}),
                       asked = reconstruct(ctx(), *network, views, {}, options);
  EXPECT_EQ(by_model.scene.gaussians.means, asked.scene.gaussians.means);
  options.merge_cell = 0, options.passes = 1;
  const Reconstruction one = reconstruct(ctx(), *network, views, {}, options);
  EXPECT_GT(one.scene.gaussians.count, by_model.scene.gaussians.count);
  options.passes.reset();
  options.forward.selection = &one.selected;
  EXPECT_EQ(reconstruct(ctx(), *network, views, {}, options).scene.gaussians.means, one.scene.gaussians.means);
  options.passes = 2;
  EXPECT_THROW(reconstruct(ctx(), *network, views, {}, options), Error);
  Config moved = golden.config();
  moved.rebase = "move";
  options.forward.selection = nullptr;
  EXPECT_THROW(reconstruct(ctx(), *make_network(ctx(), moved, golden.weights()), views, {}, options), Error);
}

TEST_P(Reconstruct, DumpsEveryStageUnderItsGoldenName) {
  const Golden golden = Golden::load("micro");
  const auto network = make_network(ctx(), golden.config(), golden.weights());
  ReconstructOptions options;
  const test::TemporaryFolder folder;
  options.dump = folder / "dump";
  reconstruct(ctx(), *network, golden_views(golden, {}), {}, options);
  const SafetensorsFile file(options.dump + "/stages.safetensors");
  for (const char* name : {"stage.features", "stage.volume", "stage.logits", "stage.confidence",
                           "stage.coarse.opacities", "stage.projected", "stage.refined", "stage.final.sh"})
    EXPECT_TRUE(test::close(file.floats(file.at(name)), golden.floats(name), 1e-4)) << name;
  EXPECT_EQ(file.integers(file.at("stage.coords")), golden.integers("stage.coords"));
}

TEST_P(Reconstruct, RefusesPicturesOfAnotherSizeAndTooManyViews) {
  const Golden golden = Golden::load("micro");
  const auto network = make_network(ctx(), golden.config(), golden.weights());
  auto views = golden_views(golden, {});
  views[1].image = Image(8, 16, 3, 0.5f);
  EXPECT_THROW(reconstruct(ctx(), *network, views, {}, {}), Error);
  EXPECT_THROW(reconstruct(ctx(), *network, {}, {}, {}), Error);
  EXPECT_THROW(reconstruct(ctx(), *network, std::vector<PreparedView>(17, views[0]), {}, {}), Error);
}

}  // namespace
}  // namespace vsplat
