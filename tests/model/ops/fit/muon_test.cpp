#include "model/ops/fit/muon.h"

#include <Eigen/Dense>

#include "tests/support/compare.h"
#include "tests/support/operation.h"

namespace vsplat {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

Eigen::MatrixXd matrix(const std::vector<float>& x, long rows) {
  const std::vector<double> values(x.begin(), x.end());
  return Eigen::Map<const RowMajor>(values.data(), rows, static_cast<long>(x.size()) / rows);
}

std::vector<double> by_rows(const Eigen::MatrixXd& x) {
  const RowMajor rows = x;
  return {rows.data(), rows.data() + rows.size()};
}

class Muon : public test::FlavourTest {
 protected:
  Tensor random(long n, long k, std::uint32_t seed) {
    return ctx().upload({n, k}, test::random_floats(static_cast<std::size_t>(n * k), seed));
  }
  Tensor zeros(long n, long k) {
    return ctx().upload({n, k}, std::vector<float>(static_cast<std::size_t>(n * k), 0.0f));
  }
  std::vector<float> values(const Tensor& t) { return ctx().read<float>(t); }
};
VSPLAT_FLAVOURS(Muon);
VSPLAT_OPERATION(Muon, muon)

// What it is for: directions that the gradient hardly has are moved along as far as those that it has most.
TEST_P(Muon, MovesEveryDirectionAsFar) {
  const long n = 48, k = 40;
  const Eigen::JacobiSVD<Eigen::MatrixXd> of(matrix(test::random_floats(static_cast<std::size_t>(n * k), 5), n),
                                             Eigen::ComputeThinU | Eigen::ComputeThinV);
  Eigen::VectorXd spread(k);
  for (long i = 0; i < k; ++i) spread[i] = std::pow(10.0, -2.0 * static_cast<double>(i) / static_cast<double>(k));
  const std::vector<double> grad = by_rows(of.matrixU() * spread.asDiagonal() * of.matrixV().transpose());
  MuonStep a{zeros(n, k), ctx().upload({n, k}, std::vector<float>(grad.begin(), grad.end())), zeros(n, k), {}};
  a.lr = 1;
  muon_step(ctx(), a);
  const Eigen::VectorXd found = Eigen::JacobiSVD<Eigen::MatrixXd>(matrix(values(a.param), n)).singularValues();
  const double step = 0.2 * std::sqrt(static_cast<double>(n));
  EXPECT_LT(found.maxCoeff(), 1.25 * step);
  EXPECT_GT(found.minCoeff(), 0.6 * step);
}

// A convolution's weight: all but the outputs are columns.
TEST_P(Muon, TakesAConvolutionAsAMatrix) {
  const std::vector<float> start = test::random_floats(5 * 3 * 8, 1), grad = test::random_floats(5 * 3 * 8, 2);
  const std::vector<float> none(start.size(), 0.0f);
  std::vector<std::vector<float>> found;
  for (const Shape& shape : {Shape{5, 3, 2, 2, 2}, Shape{5, 24}}) {
    const MuonStep a{ctx().upload(shape, start), ctx().upload(shape, grad), ctx().upload(shape, none), {}};
    muon_step(ctx(), a);
    found.push_back(values(a.param));
  }
  EXPECT_EQ(found[0], found[1]);
}

TEST_P(Muon, WithoutAGradientDecayGoesOn) {
  MuonStep a{random(4, 9, 1), zeros(4, 9), zeros(4, 9), {}};
  a.lr = 0.5, a.weight_decay = 0.5;
  std::vector<double> expected;
  for (const float w : values(a.param)) expected.push_back(0.75 * static_cast<double>(w));
  muon_step(ctx(), a);
  EXPECT_TRUE(test::close(values(a.param), expected, 1e-6));
}

TEST_P(Muon, RefusesWhatIsNoMatrix) {
  MuonStep a{ctx().upload({3}, std::vector<float>(3)), {}, {}, {}};
  EXPECT_THROW(muon_step(ctx(), a), Error);
}

}  // namespace
}  // namespace vsplat
