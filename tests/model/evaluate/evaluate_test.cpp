#include "model/evaluate/evaluate.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "model/io/picture/contact_sheet.h"
#include "model/metrics/metrics.h"
#include "model/networks/params/init.h"
#include "model/reconstruct/reconstruct.h"
#include "model/render/render.h"
#include "runtime/fail.h"
#include "tests/support/data_sets.h"
#include "tests/support/device.h"
#include "tests/support/refusal.h"

namespace vsplat {
namespace {

using test::TemporaryFolder;

constexpr int kSide = 16, kViews = 11;

// micro with an effective confidence head: some voxels are selected, some are not.
struct Model {
  explicit Model(Context& ctx, const std::vector<std::string>& fields = {})
      : config(with_fields(named_config("micro"), fields)),
        network(make_network(ctx, config, initial_weights(config, 3))) {}
  Config config;
  std::unique_ptr<Network> network;
};

// PSNR of all pictures together, by definition. The share `shown` of each pixel counts; the rest is white as in b.
double psnr_of(const std::vector<Image>& a, const std::vector<Image>& b, const std::vector<Image>& shown) {
  double sum = 0, count = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    for (std::size_t k = 0; k < a[i].data.size(); ++k) {
      const double share = shown[i].data[k];
      sum += std::pow(share * std::clamp<double>(a[i].data[k], 0, 1) + 1 - share - b[i].data[k], 2);
      count += share;
    }
  return 10 * std::log10(count / sum);
}

class EvaluateTest : public test::FlavourTest {
 protected:
  void SetUp() override { test::write_solids(folder_, 3, kViews, kSide); }
  DataSet data() const { return open_data_set({folder_.string()}); }

  const TemporaryFolder folder_;
};
VSPLAT_FLAVOURS(EvaluateTest);

// Computes the same as `reconstruct` and `render` do: a scene in the user's world, drawn from listed cameras.
// `compared_size`: edge of the compared pictures; 0: the model's. `masked`: whether the pictures have alpha.
void check_against_reconstructing(Context& ctx, const TemporaryFolder& folder, int compared_size, bool masked = true,
                                  const std::vector<std::string>& fields = {}) {
  const Model model(ctx, fields);
  EvaluateOptions asked;
  asked.request.compared_size = compared_size;
  asked.request.crop = masked ? Crop::automatic : Crop::pad;
  const Evaluation got = evaluate(ctx, *model.network, open_data_set({folder.string()}), asked);
  const int side = compared_size > 0 ? compared_size : kSide;
  ASSERT_EQ(got.objects.size(), 3u);
  EXPECT_EQ(got.skipped, 0u);
  EXPECT_TRUE(got.sheet.empty());
  double mean = 0;
  for (int i = 0; i < 3; ++i) {
    const std::string name = "solid_" + std::to_string(i);
    SCOPED_TRACE(name);
    const Scores& scores = got.objects[static_cast<std::size_t>(i)].scores;
    EXPECT_EQ(got.objects[static_cast<std::size_t>(i)].name, name);
    const ViewSet set = read_views(folder / name);
    std::vector<Eigen::Vector3d> positions;
    for (const ListedView& view : set.views) positions.push_back(view.camera.centre());
    const auto prepared = [&](int view, int edge) {
      const ListedView& listed = set.views[static_cast<std::size_t>(view)];
      return prepare_view(listed.camera, listed.picture.string(), "", {edge, asked.request.crop});
    };
    // The area that a black photograph of the same size covers.
    const auto shown_of = [&](int view) {
      const Camera& camera = set.views[static_cast<std::size_t>(view)].camera;
      Image out(side, side, 3, 1.0f);
      if (masked) return out;
      out = prepare_view(camera, Image(camera.width, camera.height, 3), nullptr, {side, asked.request.crop}).image;
      for (float& v : out.data) v = 1 - v;
      return out;
    };
    std::vector<PreparedView> inputs, inputs_compared;
    std::vector<Image> truth, drawn, white, nearest, shown;
    for (const Group& group : kmeans(positions, model.config.views)) {
      inputs.push_back(prepared(group.members.front(), kSide));
      inputs_compared.push_back(prepared(group.members.front(), side));
    }
    const Reconstruction made = reconstruct(ctx, *model.network, inputs, {}, {});
    RenderOptions options;
    options.near = made.scene.near;
    const GaussianChunks scene = place_on_device(ctx, made.scene.gaussians, side * side);
    for (const Group& group : kmeans(positions, 4)) {
      const PreparedView view = prepared(group.members.back(), side);
      bool is_input = false;
      for (const PreparedView& input : inputs) is_input = is_input || input.camera.file == view.camera.file;
      if (is_input) continue;
      truth.push_back(view.image);
      shown.push_back(shown_of(group.members.back()));
      drawn.push_back(render_picture(ctx, scene, view.camera, options).colour);
      white.emplace_back(side, side, 3, 1.0f);
      const auto by_angle = [&](const PreparedView& a, const PreparedView& b) {
        const auto angle = [&](const PreparedView& v) {
          return std::acos(v.camera.centre().normalized().dot(view.camera.centre().normalized()));
        };
        return angle(a) < angle(b);
      };
      nearest.push_back(std::min_element(inputs_compared.begin(), inputs_compared.end(), by_angle)->image);
    }
    ASSERT_GE(truth.size(), 2u);
    // The evaluation stores resampled pictures in 8 bits; here they are floats.
    const double within = compared_size > 0 ? 1e-2 : 1e-4;
    EXPECT_NEAR(scores.psnr, psnr_of(drawn, truth, shown), std::max(within, 1e-3));
    EXPECT_NEAR(scores.psnr_white, psnr_of(white, truth, shown), within);
    EXPECT_NEAR(scores.psnr_nearest, psnr_of(nearest, truth, shown), within);
    EXPECT_EQ(scores.selected, static_cast<double>(made.selected.size()) / 64);
    EXPECT_NE(scores.psnr, scores.psnr_coarse);
    EXPECT_TRUE(scores.ssim > -1 && scores.ssim < 1);
    EXPECT_TRUE(std::isnan(scores.lpips_alex) && std::isnan(scores.lpips_vgg));
    mean += scores.psnr / 3;
  }
  EXPECT_NEAR(got.mean.psnr, mean, 1e-9);
  EXPECT_TRUE(std::isnan(got.mean.lpips_alex));
}

TEST_P(EvaluateTest, IsWhatReconstructingAndDrawingGives) {
  check_against_reconstructing(ctx(), folder_, 0);
  check_against_reconstructing(ctx(), folder_, 0, true, {"passes=2", "merge_cell=0.5"});
  check_against_reconstructing(ctx(), folder_, 0, true, {"fit_epochs=2"});
}

// Areas beyond the border of an unmasked photograph are not compared.
TEST_P(EvaluateTest, ComparesWhatPhotographsShow) {
  const TemporaryFolder folder;
  test::write_solids(folder, 3, kViews, kSide);
  test::take_alpha(folder, 3);
  for (const int compared_size : {0, 24}) check_against_reconstructing(ctx(), folder, compared_size, false);
}

// Photographs larger than the model's pictures: compared at full size, and at a size in between.
TEST_P(EvaluateTest, ComparesAtAnotherSize) {
  const TemporaryFolder folder;
  test::write_solids(folder, 3, kViews, 2 * kSide);
  for (const int compared_size : {2 * kSide, 24}) check_against_reconstructing(ctx(), folder, compared_size);
  const Model model(ctx());
  EvaluateOptions options;
  options.request.compared_size = kSide;
  const Evaluation same = evaluate(ctx(), *model.network, data(), options);
  EXPECT_EQ(same.mean.psnr, evaluate(ctx(), *model.network, data(), {}).mean.psnr);
  for (const int compared_size : {1, 10, 4097}) {
    options.request.compared_size = compared_size;
    test::expect_error(Status::usage, {"evaluate_size is " + std::to_string(compared_size), "11 to 4096"},
                       [&] { evaluate(ctx(), *model.network, data(), options); });
  }
}

TEST_P(EvaluateTest, RefusesNoiseThatIsNone) {
  const Model model(ctx());
  for (const double noise : {-0.1, 1.5, std::nan("")}) {
    EvaluateOptions options;
    options.pose_noise = noise;
    test::expect_error(Status::usage, {"pose_noise is ", "0 to 1"},
                       [&] { evaluate(ctx(), *model.network, data(), options); });
  }
}

TEST_P(EvaluateTest, ACoarseModelHasOneLevel) {
  const Model model(ctx(), {"levels=coarse"});
  const Evaluation got = evaluate(ctx(), *model.network, data(), {});
  for (const ObjectScores& object : got.objects) EXPECT_EQ(object.scores.psnr, object.scores.psnr_coarse);
}

TEST_P(EvaluateTest, RandomViewsGoByTheSeed) {
  const TemporaryFolder folder;
  test::write_solids(folder, 1, 2 + 2 * 10, kSide);  // two inputs, and twice as many others as are compared
  const DataSet set = open_data_set({folder.string()});
  const Model model(ctx());
  const auto psnr = [&](Protocol protocol, std::uint64_t seed) {
    EvaluateOptions options;
    options.request.protocol = protocol;
    options.request.seed = seed;
    return evaluate(ctx(), *model.network, set, options).mean.psnr;
  };
  const double first = psnr(Protocol::random10, 0);
  EXPECT_EQ(psnr(Protocol::random10, 0), first);
  EXPECT_NE(psnr(Protocol::random10, 1), first);
  EXPECT_NE(psnr(Protocol::kmeans, 0), first);
  EXPECT_EQ(psnr(Protocol::kmeans, 1), psnr(Protocol::kmeans, 0)) << "the seed is of random views alone";
}

TEST_P(EvaluateTest, TheSheetShowsBestMedianAndWorst) {
  const Model model(ctx());
  EvaluateOptions options;
  options.sheet = true;
  const Image sheet = evaluate(ctx(), *model.network, data(), options).sheet;
  const int step = kSide + ContactSheet::margin;
  EXPECT_EQ(sheet.width, 12 * step + ContactSheet::margin);
  const int down = step + ContactSheet::label_height;
  EXPECT_EQ(sheet.height, 4 * down + ContactSheet::margin);
  // The first input of the best object, and below it the first novel view unchanged.
  Evaluation numbers = evaluate(ctx(), *model.network, data(), {});
  const auto best = std::max_element(numbers.objects.begin(), numbers.objects.end(),
                                     [](const auto& a, const auto& b) { return a.scores.psnr < b.scores.psnr; });
  const DataSet set = data();
  const EvaluationObject object = evaluation_object(
      set.objects[static_cast<std::size_t>(best - numbers.objects.begin())], model.config.taken(), {});
  const auto cell = [&](int row, const Image& want) {
    double worst = 0;
    for (int y = 0; y < kSide; ++y)
      for (int x = 0; x < kSide; ++x)
        for (int c = 0; c < 3; ++c)
          worst = std::max<double>(
              worst, std::abs(sheet.at(ContactSheet::margin + x, ContactSheet::margin + row * down + y)[c] -
                              want.at(x, y)[c]));
    return worst;
  };
  EXPECT_LT(cell(0, object.pictures[0]), 1e-6);
  EXPECT_LT(cell(1, object.pictures[object.inputs]), 1e-6);
  EXPECT_GT(cell(2, object.pictures[object.inputs]), 1e-2);
}

TEST_P(EvaluateTest, BadDataAreNamedOrPassedOver) {
  const Model model(ctx());
  const std::string picture = folder_ / "solid_1/images/0000.png";  // the first input
  test::put_file(picture, test::contents_of(picture).substr(0, 60));
  nlohmann::json views = test::read_transforms(folder_ / "solid_2");
  for (auto& frame : views["frames"]) frame["transform_matrix"][0][0] = 7;
  test::write_transforms(folder_ / "solid_2", views);
  test::expect_error(Status::format, {"object solid_1: view 0", "0000.png"},
                     [&] { evaluate(ctx(), *model.network, data(), {}); });
  EvaluateOptions options;
  options.skip_bad = true;
  const test::Warnings warnings;
  const Evaluation got = evaluate(ctx(), *model.network, data(), options);
  ASSERT_EQ(got.objects.size(), 2u);
  EXPECT_EQ(got.objects[1].name, "solid_1");
  EXPECT_EQ(got.skipped, 1u);
  EXPECT_NE(warnings.text().find("a view is left out: object solid_1: view 0"), std::string::npos) << warnings.text();
  EXPECT_NE(warnings.text().find("an object is left out: object solid_2"), std::string::npos) << warnings.text();

  std::filesystem::remove_all(folder_ / "solid_0");
  std::filesystem::remove_all(folder_ / "solid_1");
  EXPECT_THROW(evaluate(ctx(), *model.network, data(), options), Error);
}

TEST_P(EvaluateTest, ProgressMayStopIt) {
  const Model model(ctx());
  EvaluateOptions options;
  std::vector<std::string> reported;
  options.progress = [&](const std::string& object, double done) {
    EXPECT_NEAR(done, static_cast<double>(reported.size()) / 3, 1e-12);
    reported.push_back(object);
    if (reported.size() == 2) fail(Status::cancelled, "enough");
  };
  EXPECT_THROW(evaluate(ctx(), *model.network, data(), options), Error);
  EXPECT_EQ(reported, (std::vector<std::string>{"solid_0", "solid_1"}));
}

}  // namespace
}  // namespace vsplat
