// Comparisons whose messages state position, size and reference of an error.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "model/diagnose/selftest/inputs/random_values.h"

namespace vsplat::test {

using selftest::as_doubles;
using selftest::as_floats;
using selftest::nans;
using selftest::random_doubles;
using selftest::random_floats;

// Largest |got - want| over the largest |want|; a gap (NaN) fails, and so does an expectation that is all zeros where
// there should be something to compare (allow_zero).
template <class G, class W>
::testing::AssertionResult close(const std::vector<G>& got, const std::vector<W>& want, double tolerance,
                                 bool allow_zero = false) {
  if (got.size() != want.size())
    return ::testing::AssertionFailure() << got.size() << " values, " << want.size() << " expected";
  double largest = 0, worst = -1;
  std::size_t at = 0;
  for (std::size_t i = 0; i < want.size(); ++i) {
    largest = std::max(largest, std::abs(static_cast<double>(want[i])));
    const double error = std::abs(static_cast<double>(got[i]) - static_cast<double>(want[i]));
    if (!(error <= worst)) worst = error, at = i;
    if (!std::isfinite(error))
      return ::testing::AssertionFailure()
             << "index " << i << " of " << want.size() << ": " << got[i] << ", " << want[i] << " expected";
  }
  if (want.empty()) return ::testing::AssertionSuccess();
  if (largest == 0 && !allow_zero)
    return ::testing::AssertionFailure() << "all expected values are 0: nothing is tested";
  if (worst <= tolerance * (largest > 0 ? largest : 1)) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "index " << at << " of " << want.size() << ": " << got[at] << ", " << want[at]
                                       << " expected (off by " << worst / (largest > 0 ? largest : 1)
                                       << " of the largest, " << largest << "; at most " << tolerance << ")";
}

// As close(), for rows of `channels` numbers whose scales may differ (a position beside a logit, a gradient beside
// another's): each channel must be within the tolerance of its own largest value. A channel that should be all zeros is
// compared with the smallest of the others.
template <class G, class W>
::testing::AssertionResult close_by_channel(const std::vector<G>& got, const std::vector<W>& want, std::size_t channels,
                                            double tolerance) {
  if (got.size() != want.size() || channels == 0 || want.size() % channels != 0)
    return ::testing::AssertionFailure() << got.size() << " values, " << want.size() << " expected, in rows of "
                                         << channels;
  if (want.empty()) return ::testing::AssertionSuccess();
  std::vector<double> largest(channels, 0);
  for (std::size_t i = 0; i < want.size(); ++i)
    largest[i % channels] = std::max(largest[i % channels], std::abs(static_cast<double>(want[i])));
  double smallest = std::numeric_limits<double>::infinity();
  for (const double v : largest)
    if (v > 0) smallest = std::min(smallest, v);
  if (std::isinf(smallest)) return ::testing::AssertionFailure() << "all expected values are 0: nothing is tested";
  double worst = -1;
  std::size_t at = 0;
  for (std::size_t i = 0; i < want.size(); ++i) {
    const double scale = largest[i % channels] > 0 ? largest[i % channels] : smallest;
    const double error = std::abs(static_cast<double>(got[i]) - static_cast<double>(want[i])) / scale;
    if (!(error <= worst)) worst = error, at = i;
    if (!std::isfinite(error)) break;
  }
  if (worst <= tolerance) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << "row " << at / channels << ", channel " << at % channels << " of " << channels
                                       << ": " << got[at] << ", " << want[at] << " expected (off by " << worst
                                       << " of the channel's largest, " << largest[at % channels] << "; at most "
                                       << tolerance << ")";
}

}  // namespace vsplat::test
