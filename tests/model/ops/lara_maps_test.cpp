#include "model/ops/lara_maps.h"

#include <gtest/gtest.h>

#include <cmath>

#include "model/selftest/reference/lara_maps.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

// Smooth maps but for a hole, a step and colours out of range.
struct Maps {
  Maps(int w, int h) : camera(test::make_camera({"", 0, 0, w, h, "off-centre"}, 7)) {
    const auto n = static_cast<std::size_t>(w) * static_cast<std::size_t>(h);
    colour = test::random_floats(3 * n, 1, -0.3f, 1.3f);
    normal = test::random_floats(3 * n, 2);
    alpha = test::random_floats(n, 3, 0.1f, 0.99f);
    const std::vector<float> rough = test::random_floats(n, 4, 0.0f, 0.05f);
    for (std::size_t i = 0; i < n; ++i) {
      const auto x = static_cast<float>(i % static_cast<std::size_t>(w)),
                 y = static_cast<float>(i) / static_cast<float>(w);
      if (i % 7 == 3) alpha[i] = 0;
      depth.push_back(alpha[i] * (1.5f + 0.03f * x - 0.02f * y + (x > 9 ? 0.5f : 0.0f) + rough[i]));
    }
    for (float& c : colour)
      if (std::abs(c) < 0.01f || std::abs(c - 1) < 0.01f) c = 0.5f;  // off the ends, for differences
  }

  ref::PictureMaps wide() const {
    const auto widened = [](const std::vector<float>& v) { return std::vector<double>(v.begin(), v.end()); };
    return {widened(colour), widened(alpha), widened(depth), widened(normal)};
  }

  Camera camera;
  std::vector<float> colour, alpha, depth, normal;
};

class LaraMapsOp : public test::FlavourTest {
 protected:
  struct Device {
    DevicePicture picture;
    Tensor views;
  };

  Device to_device(const Maps& m) {
    const long h = m.camera.height, w = m.camera.width;
    Device d;
    d.picture = {ctx().upload({h, w, 3}, m.colour), ctx().upload({h, w}, m.alpha), ctx().upload({h, w}, m.depth),
                 ctx().upload({h, w, 3}, m.normal)};
    d.views = upload_views(ctx(), {test::make_camera({"", 0, 0, 5, 5, ""}, 9), m.camera}, 0.2f, {});
    return d;
  }

  void check(int width, int height) {
    SCOPED_TRACE(std::to_string(width) + " x " + std::to_string(height));
    const Maps m(width, height);
    const Device d = to_device(m);
    const LaraMaps got = lara_maps_forward(ctx(), {d.picture, d.views, 1});
    const ref::PictureMaps wide = m.wide();
    const ref::LaraMaps want = ref::lara_maps(wide, m.camera, wide.alpha);
    EXPECT_TRUE(test::close(ctx().read<float>(got.image), want.image, 0));
    EXPECT_TRUE(test::close(ctx().read<float>(got.depth), want.depth, 1e-6, true));
    EXPECT_TRUE(test::close(ctx().read<float>(got.normal), want.normal, 1e-6));
    EXPECT_TRUE(test::close(ctx().read<float>(got.depth_normal), want.depth_normal, 3e-5, true));

    const auto random = [&](const Tensor& like, std::uint32_t seed) {
      return test::random_floats(static_cast<std::size_t>(like.count()), seed);
    };
    const std::vector<float> image = random(got.image, 11), alpha = random(got.depth, 12),
                             depth = random(got.depth, 13), normal = random(got.normal, 14),
                             depth_normal = random(got.normal, 15);
    const auto upload = [&](const std::vector<float>& v, const Tensor& like) { return ctx().upload(like.shape(), v); };
    const PictureGradient by = lara_maps_backward(
        ctx(), {d.picture,
                d.views,
                1,
                {upload(image, got.image), upload(alpha, got.depth), upload(depth, got.depth),
                 upload(normal, got.normal), upload(depth_normal, got.normal), upload(alpha, got.depth)}});
    EXPECT_EQ(ctx().read<float>(by.distortion), alpha);
    const auto loss = [&](const ref::PictureMaps& maps) {
      const ref::LaraMaps l = ref::lara_maps(maps, m.camera, wide.alpha);
      double sum = 0;
      const auto add = [&sum](const std::vector<double>& map, const std::vector<float>& g) {
        for (std::size_t i = 0; i < g.size(); ++i) sum += map[i] * g[i];
      };
      add(l.image, image), add(maps.alpha, alpha), add(l.depth, depth), add(l.normal, normal);
      add(l.depth_normal, depth_normal);
      return sum;
    };
    const auto differences = [&](std::vector<double> ref::PictureMaps::*field) {
      std::vector<double> out;
      ref::PictureMaps moved = wide;
      for (double& value : moved.*field) {
        const double base = value;
        const auto slope = [&](double step) {
          value = base + step;
          const double above = loss(moved);
          value = base - step;
          const double below = loss(moved);
          value = base;
          return (above - below) / (2 * step);
        };
        // (Where alpha is 0 nothing moves with what is drawn but alpha's own.)
        out.push_back(base == 0 && field == &ref::PictureMaps::alpha ? alpha[out.size()]
                                                                     : (4 * slope(5e-7) - slope(1e-6)) / 3);
      }
      return out;
    };
    EXPECT_TRUE(test::close(ctx().read<float>(by.colour), differences(&ref::PictureMaps::colour), 1e-5));
    EXPECT_TRUE(test::close(ctx().read<float>(by.alpha), differences(&ref::PictureMaps::alpha), 5e-5));
    EXPECT_TRUE(test::close(ctx().read<float>(by.depth), differences(&ref::PictureMaps::depth), 5e-5, true));
    EXPECT_TRUE(test::close(ctx().read<float>(by.normal), differences(&ref::PictureMaps::normal), 1e-5));
  }
};

TEST_P(LaraMapsOp, MatchesReferenceAndItsDifferences) {
  for (const auto& [width, height] : {std::pair{1, 1}, {3, 3}, {2, 17}, {17, 2}, {7, 13}, {17, 5}})
    check(width, height);
}

TEST_P(LaraMapsOp, TakesWhatIsNoneAsZeros) {
  const Maps m(7, 5);
  const Device d = to_device(m);
  const std::vector<float> by = test::random_floats(35, 3), zeros(35, 0.0f), colours(105, 0.0f);
  const auto one = [&](const std::vector<float>& v) { return ctx().upload({5, 7}, v); };
  const auto three = [&](const std::vector<float>& v) { return ctx().upload({5, 7, 3}, v); };
  const PictureGradient few = lara_maps_backward(ctx(), {d.picture, d.views, 1, {{}, {}, one(by), {}, {}, {}}});
  const PictureGradient all = lara_maps_backward(
      ctx(),
      {d.picture, d.views, 1, {three(colours), one(zeros), one(by), three(colours), three(colours), one(zeros)}});
  EXPECT_FALSE(few.colour || few.normal || few.distortion);
  EXPECT_EQ(ctx().read<float>(few.alpha), ctx().read<float>(all.alpha));
  EXPECT_EQ(ctx().read<float>(few.depth), ctx().read<float>(all.depth));
  EXPECT_EQ(ctx().read<float>(all.colour), colours);
  EXPECT_EQ(ctx().read<float>(all.normal), colours);
  const PictureGradient none = lara_maps_backward(ctx(), {d.picture, d.views, 1, {}});
  EXPECT_FALSE(none.colour || none.alpha || none.depth || none.normal);
}

// Where nothing is drawn there is no surface, and no gradient that is no number.
TEST_P(LaraMapsOp, IsZeroWhereNothingIsDrawn) {
  Maps m(5, 4);
  std::fill(m.alpha.begin(), m.alpha.end(), 0.0f);
  std::fill(m.depth.begin(), m.depth.end(), 0.0f);
  const Device d = to_device(m);
  const LaraMaps got = lara_maps_forward(ctx(), {d.picture, d.views, 1});
  const Tensor by = ctx().upload({4, 5, 3}, std::vector<float>(60, 1.0f));
  const PictureGradient back = lara_maps_backward(ctx(), {d.picture, d.views, 1, {{}, {}, {}, {}, by, {}}});
  for (const Tensor& map : {got.depth, got.depth_normal, back.alpha, back.depth})
    for (const float v : ctx().read<float>(map)) EXPECT_EQ(v, 0.0f);
}

TEST_P(LaraMapsOp, RejectsBadShape) {
  const Maps m(5, 4);
  Device d = to_device(m);
  EXPECT_THROW(lara_maps_forward(ctx(), {d.picture, d.views, 2}), Error);
  EXPECT_THROW(lara_maps_backward(ctx(), {d.picture, d.views, 1, {ctx().tensor({4, 4, 3}), {}, {}, {}, {}, {}}}),
               Error);
  d.picture.normal = Tensor();
  EXPECT_THROW(lara_maps_forward(ctx(), {d.picture, d.views, 1}), Error);
}

VSPLAT_FLAVOURS(LaraMapsOp);

}  // namespace
}  // namespace vsplat
