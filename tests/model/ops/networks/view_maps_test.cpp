#include "model/ops/networks/view_maps.h"

#include "model/diagnose/selftest/reference/view_maps.h"
#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

class ViewMaps : public test::FlavourTest {
 protected:
  static constexpr long kViews = 3;
  // Colours on both sides of [0,1]; a third of the pixels has nothing in it.
  void make(long edge, long views) {
    const auto pixels = static_cast<std::size_t>(views * edge * edge);
    images_ = test::random_floats(static_cast<std::size_t>(kViews * edge * edge) * 3, 1, 0, 1);
    colour_ = test::random_floats(3 * pixels, 2, -0.5f, 1.5f), alpha_ = test::random_floats(pixels, 3, -0.5f, 1);
    depth_ = test::random_floats(pixels, 4, 0.5f, 3);
    for (std::size_t i = 0; i < pixels; ++i)
      if (alpha_[i] <= 0) alpha_[i] = depth_[i] = 0;
    drawings_ = {ctx().upload({views, edge, edge, 3}, colour_), ctx().upload({views, edge, edge}, alpha_),
                 ctx().upload({views, edge, edge}, depth_)};
  }
  std::vector<float> images_, colour_, alpha_, depth_;
  ViewDrawings drawings_;
};
VSPLAT_FLAVOURS(ViewMaps);
VSPLAT_OPERATION(ViewMaps, view_maps)

TEST_P(ViewMaps, BackwardIsOfDifferences) {
  constexpr double step = 1e-6;
  for (const bool by_alpha : {false, true}) {
    make(7, 2);
    const auto dmaps = test::random_floats(static_cast<std::size_t>(kViews) * 49 * 8, 5);
    std::vector<double> dcolour, dalpha, ddepth;
    for (std::size_t i = 0; i < 98; ++i) {
      double at[5] = {colour_[3 * i], colour_[3 * i + 1], colour_[3 * i + 2], alpha_[i], depth_[i]};
      const auto loss = [&] {
        double sum = 0;
        const std::vector<double> y = ref::view_map(at, at[3], at[4], by_alpha);
        for (std::size_t c = 0; c < 5; ++c) sum += y[c] * static_cast<double>(dmaps[8 * (49 + i) + 3 + c]);
        return sum;
      };
      for (int k = 0; k < 5; ++k) {
        const double before = at[k];
        // Where nothing is drawn alpha has no two sides: its gradient is that of the map's alpha alone.
        const bool edge = k >= 3 && before == 0;
        at[k] = before + step;
        const double more = loss();
        at[k] = before - step;
        double slope = (more - loss()) / (2 * step);
        at[k] = before;
        if (edge && by_alpha) slope = k == 3 ? static_cast<double>(dmaps[8 * (49 + i) + 6]) : 0;
        (k < 3 ? dcolour : k == 3 ? dalpha : ddepth).push_back(slope);
      }
    }
    const auto gap = [&](const Tensor& x) {
      return ctx().upload(x.shape(), test::nans(static_cast<std::size_t>(x.count())));
    };
    const ViewDrawings d{gap(drawings_.colour), gap(drawings_.alpha), gap(drawings_.depth)};
    view_maps_backward(ctx(), {drawings_, 1, by_alpha, ctx().upload({kViews, 7, 7, 8}, dmaps), d});
    EXPECT_TRUE(test::close(ctx().read<float>(d.colour), dcolour, 1e-5));
    EXPECT_TRUE(test::close(ctx().read<float>(d.alpha), dalpha, 1e-5));
    EXPECT_TRUE(test::close(ctx().read<float>(d.depth), ddepth, 1e-5));
  }
}

TEST_P(ViewMaps, RejectsBadShape) {
  make(3, 2);
  const Tensor images = ctx().tensor({3, 3, 3, 3}), maps = ctx().tensor({3, 3, 3, 8});
  EXPECT_THROW(view_maps_forward(ctx(), {images, drawings_, 2, false, maps}), Error) << "views 2 to 4 of 3";
  EXPECT_THROW(view_maps_forward(ctx(), {images, drawings_, 0, false, ctx().tensor({3, 3, 3, 7})}), Error);
  EXPECT_THROW(view_maps_backward(ctx(), {drawings_, 2, false, maps, drawings_}), Error);
}

}  // namespace
}  // namespace vsplat
