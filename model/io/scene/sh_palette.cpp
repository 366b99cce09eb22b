#include "model/io/scene/sh_palette.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <thread>

#include "runtime/fail.h"
#include "runtime/share_out.h"

namespace vsplat {
namespace {

using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using RowMap = Eigen::Map<Rows>;

constexpr std::size_t kMostCentroids = 65536;
constexpr std::size_t kPartCentroids = 512;  // of a part that is not divided further
constexpr int kIterations = 4;               // of k-means in each part
constexpr int kPowerSteps = 6;               // towards the axis of a part's largest variance
constexpr std::size_t kSampleRows = 16384;   // from which that axis is found
constexpr std::size_t kRowsAtOnce = 256;     // whose distances to all centroids of a part are computed together

// The rows [first, first + count), which get `centroids` of the palette's from `begin` on.
struct Part {
  std::size_t first = 0, count = 0, begin = 0, centroids = 0;
};

// The vectors, reordered so that those of a part are neighbours.
class Divided {
 public:
  Divided(std::vector<float>& vectors, std::size_t width)
      : vectors_(vectors), width_(width), row_of_(vectors.size() / width) {
    std::iota(row_of_.begin(), row_of_.end(), 0u);
  }

  RowMap rows(std::size_t first, std::size_t count) const {
    return {&vectors_[first * width_], static_cast<Eigen::Index>(count), static_cast<Eigen::Index>(width_)};
  }
  std::uint32_t row_of(std::size_t at) const { return row_of_[at]; }

  // Divides the part in two by a plane through its mean, across the axis of its largest variance. The centroids are
  // shared by the squared errors of both sides. False if all of its vectors are equal.
  bool divide(const Part& part, Part& low, Part& high) {
    const RowMap all = rows(part.first, part.count);
    const Eigen::RowVectorXf mean = mean_of(all);
    const Eigen::VectorXf axis = axis_of(all, mean);
    if (axis.isZero(0)) return false;
    const float at = mean * axis;
    std::size_t begin = part.first, end = part.first + part.count;
    while (begin < end) {
      if (rows(begin, 1).row(0).dot(axis) < at)
        ++begin;
      else
        exchange(begin, --end);
    }
    low = {part.first, begin - part.first, part.begin, 0};
    high = {begin, part.count - low.count, part.begin, 0};
    if (low.count == 0 || high.count == 0) return false;
    const double a = error_of(low), b = error_of(high);
    const double share = a + b > 0 ? a / (a + b) : 0.5;
    auto given = static_cast<std::size_t>(std::llround(share * static_cast<double>(part.centroids)));
    const std::size_t least = part.centroids > high.count ? part.centroids - high.count : 1;
    given = std::clamp(given, std::max<std::size_t>(1, least), std::min(low.count, part.centroids - 1));
    low.centroids = given;
    high.centroids = part.centroids - given;
    high.begin = part.begin + given;
    return true;
  }

 private:
  static Eigen::RowVectorXf mean_of(const RowMap& all) {
    Eigen::RowVectorXd sum = Eigen::RowVectorXd::Zero(all.cols());
    for (Eigen::Index i = 0; i < all.rows(); ++i) sum += all.row(i).cast<double>();
    return (sum / static_cast<double>(all.rows())).cast<float>();
  }

  static Eigen::VectorXf axis_of(const RowMap& all, const Eigen::RowVectorXf& mean) {
    const auto step = static_cast<Eigen::Index>((static_cast<std::size_t>(all.rows()) + kSampleRows - 1) / kSampleRows);
    Rows sample((all.rows() + step - 1) / step, all.cols());
    for (Eigen::Index i = 0; i < sample.rows(); ++i) sample.row(i) = all.row(i * step) - mean;
    Rows covariance = sample.transpose() * sample;
    Eigen::Index widest = 0;
    const float variance = covariance.diagonal().maxCoeff(&widest);
    if (!(variance > 0)) {  // the sample's vectors are equal: use the widest coordinate of all
      const Eigen::RowVectorXf range = all.colwise().maxCoeff() - all.colwise().minCoeff();
      const float most = range.maxCoeff(&widest);
      return most > 0 ? Eigen::VectorXf(Eigen::VectorXf::Unit(all.cols(), widest))
                      : Eigen::VectorXf(Eigen::VectorXf::Zero(all.cols()));
    }
    covariance /= variance;
    Eigen::VectorXf axis = covariance.col(widest);
    for (int i = 0; i < kPowerSteps; ++i) axis = (covariance * axis).eval().normalized();
    return axis;
  }

  double error_of(const Part& part) const {
    const RowMap all = rows(part.first, part.count);
    const Eigen::RowVectorXf mean = mean_of(all);
    double out = 0;
    for (Eigen::Index i = 0; i < all.rows(); ++i) out += static_cast<double>((all.row(i) - mean).squaredNorm());
    return out;
  }

  void exchange(std::size_t a, std::size_t b) {
    if (a == b) return;
    std::swap_ranges(&vectors_[a * width_], &vectors_[a * width_] + width_, &vectors_[b * width_]);
    std::swap(row_of_[a], row_of_[b]);
  }

  std::vector<float>& vectors_;
  std::size_t width_;
  std::vector<std::uint32_t> row_of_;  // where each vector stood at first
};

// Divides a part until every piece has at most `most` centroids.
std::vector<Part> divided(Divided& vectors, const Part& whole, std::size_t most) {
  std::vector<Part> out, waiting{whole};
  while (!waiting.empty()) {
    const Part part = waiting.back();
    waiting.pop_back();
    Part low, high;
    if (part.centroids > most && vectors.divide(part, low, high)) {
      waiting.push_back(high);
      waiting.push_back(low);
    } else {
      out.push_back(part);
    }
  }
  return out;
}

// The nearest of `centroids` to each row.
void assign(const RowMap& rows, const Rows& centroids, std::vector<std::uint16_t>& nearest) {
  const Eigen::RowVectorXf half = 0.5f * centroids.rowwise().squaredNorm().transpose();
  Rows distance;
  for (Eigen::Index first = 0; first < rows.rows(); first += kRowsAtOnce) {
    const Eigen::Index count = std::min<Eigen::Index>(kRowsAtOnce, rows.rows() - first);
    distance.noalias() = -rows.middleRows(first, count) * centroids.transpose();
    distance.rowwise() += half;
    for (Eigen::Index i = 0; i < count; ++i) {
      Eigen::Index at = 0;
      distance.row(i).minCoeff(&at);
      nearest[static_cast<std::size_t>(first + i)] = static_cast<std::uint16_t>(at);
    }
  }
}

// K-means within a part, from the means of its pieces.
void cluster(Divided& vectors, const Part& part, ShPalette& out) {
  const std::vector<Part> pieces = divided(vectors, part, 1);
  const auto width = static_cast<Eigen::Index>(out.width);
  const RowMap rows = vectors.rows(part.first, part.count);
  std::vector<std::uint16_t> nearest(part.count);
  for (std::size_t i = 0; i < pieces.size(); ++i)
    std::fill_n(nearest.begin() + static_cast<std::ptrdiff_t>(pieces[i].first - part.first), pieces[i].count,
                static_cast<std::uint16_t>(i));
  Rows centroids = Rows::Zero(static_cast<Eigen::Index>(pieces.size()), width);
  for (int iteration = 0;; ++iteration) {
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> sums(centroids.rows(), width);
    sums.setZero();
    std::vector<std::size_t> counts(pieces.size());
    for (std::size_t k = 0; k < part.count; ++k) {
      sums.row(nearest[k]) += rows.row(static_cast<Eigen::Index>(k)).cast<double>();
      ++counts[nearest[k]];
    }
    for (std::size_t i = 0; i < pieces.size(); ++i)  // one that no vector chose stays
      if (counts[i])
        centroids.row(static_cast<Eigen::Index>(i)) =
            (sums.row(static_cast<Eigen::Index>(i)) / static_cast<double>(counts[i])).cast<float>();
    if (iteration == kIterations || pieces.size() == 1) break;
    assign(rows, centroids, nearest);
  }
  std::copy_n(centroids.data(), centroids.size(), &out.centroids[part.begin * out.width]);
  for (std::size_t k = 0; k < part.count; ++k)
    out.labels[vectors.row_of(part.first + k)] = static_cast<std::uint16_t>(part.begin + nearest[k]);
}

}  // namespace

std::size_t sh_palette_size(std::size_t count) {
  std::size_t size = 1024;
  while (size < kMostCentroids && 2 * size <= count) size *= 2;
  return std::min(size, count);
}

ShPalette make_sh_palette(std::vector<float> vectors, std::size_t width, std::size_t size) {
  const std::size_t count = vectors.size() / width;
  if (size == 0 || size > kMostCentroids || size > count)
    fail(Status::internal, "a palette of {} for {} vectors", size, count);
  ShPalette out;
  out.width = width;
  out.centroids.resize(size * width);
  out.labels.resize(count);
  Divided divided_vectors(vectors, width);
  const std::vector<Part> parts = divided(divided_vectors, {0, count, 0, size}, kPartCentroids);
  ShareOut shared;
  shared.items = parts.size();
  shared.workers = std::clamp(std::thread::hardware_concurrency(), 1u, 64u);
  shared.ahead = parts.size();
  shared.work = [&](std::size_t, std::size_t i) { cluster(divided_vectors, parts[i], out); };
  share_out(shared);
  return out;
}

}  // namespace vsplat
