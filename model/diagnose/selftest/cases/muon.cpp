#include "model/diagnose/selftest/reference/muon.h"

#include <array>

#include "model/diagnose/selftest/cases/cases.h"
#include "model/ops/fit/muon.h"

namespace vsplat::selftest {
namespace {

void muon_all(Checks& c) {
  for (const auto& [n, k] : c.some({std::array<long, 2>{1, 7}, {7, 1}, {31, 32}, {33, 32}, {13, 101}, {65, 129}},
                                   {{1, 1}, {3, 3}, {101, 13}, {64, 65}})) {
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const auto matrix = [rows = n](const std::vector<float>& x) -> Eigen::MatrixXd {
      const auto values = as_doubles(x);
      return Eigen::Map<const RowMajor>(values.data(), rows, static_cast<long>(x.size()) / rows);
    };
    const auto by_rows = [](const Eigen::MatrixXd& x) {
      const RowMajor rows = x;
      return std::vector<double>(rows.data(), rows.data() + rows.size());
    };
    const auto count = static_cast<std::size_t>(n * k);
    const auto start = random_floats(count, 1);
    MuonStep a{c.up({n, k}, start), {}, c.zeros({n, k}), c.up({2}, std::vector<float>{7.0f, 0.25f})};
    a.lr = 0.1, a.weight_decay = 0.5;
    Eigen::MatrixXd param = matrix(start), m = Eigen::MatrixXd::Zero(n, k);
    for (std::uint32_t step = 1; step <= (c.all ? 3u : 2u); ++step) {
      const auto grad = random_floats(count, 1 + step);
      a.grad = c.up({n, k}, grad);
      muon_step(c.ctx, a);
      ref::muon({a.lr, a.momentum, a.weight_decay}, 0.25 * matrix(grad), param, m);
    }
    c.close("weights", a.param, by_rows(param), 2e-5);
    c.close("moments", a.m, by_rows(m), 1e-6);
  }
}

}  // namespace

VSPLAT_CASES(muon, {"muon", muon_all})

}  // namespace vsplat::selftest
