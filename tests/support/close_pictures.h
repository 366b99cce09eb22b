// Compares pictures in which single pixels flip at the thresholds.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "model/render/render.h"

namespace vsplat::test {

// 99.9 % of the values within 2e-3 of the largest (or `least`), their mean within 1e-5.
inline ::testing::AssertionResult close_but_for_flips(const std::vector<float>& got, const std::vector<double>& want,
                                                      double least = 1) {
  if (got.size() != want.size())
    return ::testing::AssertionFailure() << got.size() << " values, " << want.size() << " expected";
  double largest = least, sum = 0;
  for (const double v : want) largest = std::max(largest, std::abs(v));
  std::vector<double> errors;
  for (std::size_t i = 0; i < want.size(); ++i) {
    const double e = std::abs(got[i] - want[i]) / largest;
    if (!std::isfinite(e)) return ::testing::AssertionFailure() << "value " << i << " is " << got[i];
    errors.push_back(e);
    sum += e;
  }
  std::sort(errors.begin(), errors.end());
  const double q = errors[static_cast<std::size_t>(0.999 * static_cast<double>(errors.size() - 1))];
  const double mean = sum / static_cast<double>(errors.size());
  if (q <= 2e-3 && mean <= 1e-5) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "99.9 % within " << q << ", mean " << mean;
}

// The same bits in every map.
inline void expect_same(const Picture& got, const Picture& want) {
  for (Image Picture::*map :
       {&Picture::colour, &Picture::alpha, &Picture::depth, &Picture::normal, &Picture::median, &Picture::distortion})
    EXPECT_EQ((got.*map).data, (want.*map).data);
}

}  // namespace vsplat::test
