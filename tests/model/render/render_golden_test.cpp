// Drawing against the PyTorch specification's pictures, scene by scene, in both flavours.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "model/render/render.h"
#include "tests/support/device.h"
#include "tests/support/splat_golden.h"
#include "tests/support/vectors.h"

namespace vsplat {
namespace {

using test::SplatGolden;

// Every value within 1e-4 of the largest (or `least`), their mean within 1e-5: these scenes avoid the thresholds at
// which pixels may flip.
::testing::AssertionResult close_pictures(const Image& got, const Image& want, double least) {
  if (got.data.size() != want.data.size())
    return ::testing::AssertionFailure() << got.data.size() << " values, " << want.data.size() << " expected";
  if (want.empty()) return ::testing::AssertionSuccess();  // volumes lack this map
  double largest = least, sum = 0, worst = 0;
  for (const float v : want.data) largest = std::max(largest, std::abs(static_cast<double>(v)));
  std::size_t at = 0;
  for (std::size_t i = 0; i < got.data.size(); ++i) {
    const double error = std::abs(static_cast<double>(got.data[i]) - want.data[i]) / largest;
    if (!std::isfinite(error)) return ::testing::AssertionFailure() << "value " << i << " is " << got.data[i];
    if (error > worst) worst = error, at = i;
    sum += error;
  }
  const double mean = sum / static_cast<double>(got.data.size());
  if (worst <= 1e-4 && mean <= 1e-5) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "value " << at << " of " << got.data.size() << ": " << got.data[at] << ", "
                                       << want.data[at] << " expected; off by " << worst << " (at most 1e-4), mean "
                                       << mean << " (1e-5)";
}

class RenderGolden : public test::VectorsTest {};

// Surfels have all maps, volumes the first three.
const std::pair<const char*, Image Picture::*> kMaps[] = {
    {"colour", &Picture::colour}, {"alpha", &Picture::alpha},   {"depth", &Picture::depth},
    {"normal", &Picture::normal}, {"median", &Picture::median}, {"distortion", &Picture::distortion}};

TEST_P(RenderGolden, MatchesAndGivesTheSameBytesEveryTime) {
  VSPLAT_NEED_SPLAT(name());
  const SplatGolden golden = SplatGolden::load(name());
  const DeviceGaussians g = upload(ctx(), golden.gaussians);
  for (std::size_t v = 0; v < golden.cameras.size(); ++v) {
    SCOPED_TRACE("camera " + std::to_string(v));
    const Picture first = render_picture(ctx(), g, golden.cameras[v], golden.options);
    for (const auto& [map, data] : kMaps)
      EXPECT_TRUE(close_pictures(first.*data, golden.pictures[v].*data, data == &Picture::distortion ? 1e-3 : 1))
          << map;
    for (int run = 0; run < 2; ++run) {
      const Picture again = render_picture(ctx(), g, golden.cameras[v], golden.options);
      for (const auto& [map, data] : kMaps) EXPECT_EQ((first.*data).data, (again.*data).data) << map;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Committed, RenderGolden, test::in_both_flavours(test::splat_committed()), test::vectors_name);
INSTANTIATE_TEST_SUITE_P(Made, RenderGolden, test::in_both_flavours(test::splat_made()), test::vectors_name);
INSTANTIATE_TEST_SUITE_P(CommittedSurfels, RenderGolden, test::in_both_flavours(test::surfels_committed()),
                         test::vectors_name);
INSTANTIATE_TEST_SUITE_P(MadeSurfels, RenderGolden, test::in_both_flavours(test::surfels_made()), test::vectors_name);

}  // namespace
}  // namespace vsplat
