#include "model/fit/outliers.h"

#include <algorithm>
#include <cmath>

#include "model/base/statistics.h"

namespace vsplat {
namespace {

constexpr double kLeastGap = 4;  // dB
constexpr double kDeviations = 4;
constexpr double kNormal = 1.4826;  // standard deviation of a normal distribution per median absolute deviation
constexpr std::size_t kLeastCount = 5;

}  // namespace

std::vector<std::size_t> find_outliers(const std::vector<FitScore>& scores) {
  std::vector<std::size_t> out;
  if (scores.size() < kLeastCount) return out;
  std::vector<double> values, distances;
  for (const FitScore& score : scores) values.push_back(score.psnr);
  const double centre = median(values);
  for (const double value : values) distances.push_back(std::abs(value - centre));
  const double gap = std::max(kLeastGap, kDeviations * kNormal * median(distances));
  for (std::size_t i = 0; i < values.size(); ++i)
    if (values[i] < centre - gap) out.push_back(i);
  std::sort(out.begin(), out.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  return out;
}

}  // namespace vsplat
