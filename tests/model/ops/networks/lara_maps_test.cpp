#include "model/ops/networks/lara_maps.h"

#include <gtest/gtest.h>

#include <cmath>

#include "model/diagnose/selftest/inputs/lara_picture.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"
#include "tests/support/scenes.h"

namespace vsplat {
namespace {

using selftest::LaraPicture;

class LaraMapsOp : public test::FlavourTest {
 protected:
  struct Device {
    DevicePicture picture;
    Tensor views;
  };

  Device to_device(const LaraPicture& m) {
    const long h = m.camera.height, w = m.camera.width;
    Device d;
    d.picture = {ctx().upload({h, w, 3}, m.colour), ctx().upload({h, w}, m.alpha), ctx().upload({h, w}, m.depth),
                 ctx().upload({h, w, 3}, m.normal)};
    d.views = upload_views(ctx(), {test::make_camera({"", 0, 0, 5, 5, ""}, 9), m.camera}, 0.2f, {});
    return d;
  }
};

TEST_P(LaraMapsOp, TakesWhatIsNoneAsZeros) {
  const LaraPicture m(7, 5);
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
  LaraPicture m(5, 4);
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
  const LaraPicture m(5, 4);
  Device d = to_device(m);
  EXPECT_THROW(lara_maps_forward(ctx(), {d.picture, d.views, 2}), Error);
  EXPECT_THROW(lara_maps_backward(ctx(), {d.picture, d.views, 1, {ctx().tensor({4, 4, 3}), {}, {}, {}, {}, {}}}),
               Error);
  d.picture.normal = Tensor();
  EXPECT_THROW(lara_maps_forward(ctx(), {d.picture, d.views, 1}), Error);
}

VSPLAT_FLAVOURS(LaraMapsOp);
VSPLAT_OPERATION(LaraMapsOp, lara_maps)

}  // namespace
}  // namespace vsplat
