#include "model/metrics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "runtime/error.h"

namespace vsplat {
namespace {

TEST(Psnr, IsTheUsualFormula) {
  Image a(5, 3, 3, 0.5f), b(5, 3, 3, 0.6f);
  EXPECT_NEAR(psnr(a, b), 20, 1e-4);
  b = a;
  EXPECT_TRUE(std::isinf(psnr(a, b)));
  b.data[7] = 1.0f;  // one of 45 values is 0.5 off
  EXPECT_NEAR(psnr(a, b), 10 * std::log10(45 / 0.25), 1e-9);
  b.data[3] = std::nanf("");
  EXPECT_TRUE(std::isnan(psnr(a, b)));
}

TEST(Psnr, RefusesOtherSizes) {
  EXPECT_THROW(psnr(Image(2, 3, 3), Image(3, 2, 3)), Error);
  EXPECT_THROW(psnr(Image(2, 3, 3), Image(2, 3, 1)), Error);
  EXPECT_THROW(psnr(Image(), Image()), Error);
}

}  // namespace
}  // namespace vsplat
