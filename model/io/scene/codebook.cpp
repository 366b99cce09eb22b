#include "model/io/scene/codebook.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vsplat {
namespace {

constexpr std::size_t kEntries = 256;
// Bins end where either kind of step ends, so that neither rare numbers nor dense ones share a wide bin. The extreme
// numbers at both ends do not widen the even steps, and have smaller bins instead.
constexpr std::size_t kEvenBins = 4096;        // of the range without the extremes
constexpr std::size_t kPopulationBins = 4096;  // of the count
constexpr std::size_t kExtremes = 1000;        // one of so many numbers at each end
constexpr std::size_t kExtremeBins = 16;       // times as many bins for these as their count alone gives

// Sums of count, numbers and squares up to each bin, about a number in the middle.
struct BinSums {
  std::vector<double> count{0}, sum{0}, square{0};
  double middle = 0;

  std::size_t bins() const { return count.size() - 1; }
  // The squared error of the bins [first, end) about their mean.
  double error(std::size_t first, std::size_t end) const {
    const double n = count[end] - count[first], s = sum[end] - sum[first];
    return std::max(0.0, square[end] - square[first] - s * s / n);
  }
  float mean(std::size_t first, std::size_t end) const {
    return static_cast<float>(middle + (sum[end] - sum[first]) / (count[end] - count[first]));
  }
};

// A bin holds at most `most` numbers that are not equal.
BinSums make_bins(const std::vector<float>& sorted, std::size_t most) {
  BinSums out;
  const std::size_t first = sorted.size() / kExtremes, last = sorted.size() - 1 - first;
  const double low = sorted[first], range = static_cast<double>(sorted[last]) - low;
  out.middle = sorted[sorted.size() / 2];
  const auto even_bin = [&](float v) {
    const double at = range > 0 ? (v - low) / range : 0;
    return static_cast<std::size_t>(std::clamp(at, 0.0, 1.0) * static_cast<double>(kEvenBins));
  };
  for (std::size_t begin = 0; begin < sorted.size();) {
    const std::size_t bin = even_bin(sorted[begin]);
    double sum = 0, square = 0;
    std::size_t end = begin;
    const bool extreme = begin < first || begin > last;
    const std::size_t limit = extreme ? std::max<std::size_t>(1, most / kExtremeBins) : most;
    while (end < sorted.size() &&
           (end == begin || sorted[end] == sorted[end - 1] || (end - begin < limit && even_bin(sorted[end]) == bin))) {
      const double v = sorted[end] - out.middle;
      sum += v;
      square += v * v;
      ++end;
    }
    out.count.push_back(static_cast<double>(end));
    out.sum.push_back(out.sum.back() + sum);
    out.square.push_back(out.square.back() + square);
    begin = end;
  }
  return out;
}

// The best partition of the bins into at most 256 intervals, by dynamic programming. The best beginning of the last
// interval does not decrease with its end, so each layer is solved by halving.
class BestIntervals {
 public:
  explicit BestIntervals(const BinSums& bins)
      : bins_(bins), before_(bins.bins() + 1), now_(bins.bins() + 1), begin_(kEntries) {
    for (std::size_t end = 1; end <= bins.bins(); ++end) before_[end] = bins.error(0, end);
    for (std::size_t layer = 1; layer < kEntries; ++layer) {
      begin_[layer].resize(bins.bins() + 1);
      solve(layer, layer + 1, bins.bins(), layer, bins.bins() - 1);
      before_.swap(now_);
    }
  }

  std::vector<float> means() const {
    std::vector<float> out(kEntries);
    std::size_t end = bins_.bins();
    for (std::size_t layer = kEntries; layer-- > 0;) {
      const std::size_t begin = layer == 0 ? 0 : begin_[layer][end];
      out[layer] = bins_.mean(begin, end);
      end = begin;
    }
    return out;
  }

 private:
  // The ends from `low` to `high`, whose last interval begins between `first` and `last`.
  void solve(std::size_t layer, std::size_t low, std::size_t high, std::size_t first, std::size_t last) {
    if (low > high) return;
    const std::size_t end = (low + high) / 2;
    double best = std::numeric_limits<double>::infinity();
    std::size_t at = first;
    for (std::size_t begin = first; begin <= std::min(last, end - 1); ++begin) {
      const double error = before_[begin] + bins_.error(begin, end);
      if (error < best) {
        best = error;
        at = begin;
      }
    }
    now_[end] = best;
    begin_[layer][end] = static_cast<std::uint16_t>(at);
    if (end > low) solve(layer, low, end - 1, first, at);
    solve(layer, end + 1, high, at, last);
  }

  const BinSums& bins_;
  std::vector<double> before_, now_;               // least error of the first bins, with one layer less, and with this
  std::vector<std::vector<std::uint16_t>> begin_;  // of the last interval, by layer and end
};

}  // namespace

Codebook::Codebook(std::vector<float> numbers) {
  std::sort(numbers.begin(), numbers.end());
  std::vector<float> different;
  for (const float v : numbers) {
    if (different.empty() || v != different.back()) different.push_back(v);
    if (different.size() > kEntries) break;
  }
  if (different.size() > kEntries) {
    std::size_t most = std::max<std::size_t>(1, numbers.size() / kPopulationBins);
    BinSums bins = make_bins(numbers, most);
    while (bins.bins() < kEntries && most > 1) bins = make_bins(numbers, most /= 2);
    different = BestIntervals(bins).means();
  }
  std::copy(different.begin(), different.end(), values_.begin());
  std::fill(values_.begin() + static_cast<std::ptrdiff_t>(different.size()), values_.end(), different.back());
}

std::uint8_t Codebook::nearest(float number) const {
  const auto above = std::lower_bound(values_.begin(), values_.end(), number);
  if (above == values_.begin()) return 0;
  if (above == values_.end()) return static_cast<std::uint8_t>(kEntries - 1);
  const bool lower = static_cast<double>(number) - *(above - 1) <= static_cast<double>(*above) - number;
  return static_cast<std::uint8_t>(above - values_.begin() - (lower ? 1 : 0));
}

}  // namespace vsplat
