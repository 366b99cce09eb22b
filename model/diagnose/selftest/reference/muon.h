// Muon in double, from its publication: https://kellerjordan.github.io/posts/muon.
#pragma once
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace vsplat::ref {

struct Muon {
  double lr, momentum, weight_decay;
};

// Newton and Schulz's iteration as published: on the wide matrix, x x^T at the left.
inline Eigen::MatrixXd orthogonal(const Eigen::MatrixXd& given) {
  const bool tall = given.rows() > given.cols();
  Eigen::MatrixXd x = tall ? given.transpose() : given;
  if (x.norm() > 0) x /= x.norm();
  for (int i = 0; i < 5; ++i) {
    const Eigen::MatrixXd a = x * x.transpose();
    x = 3.4445 * x + (-4.7750 * a + 2.0315 * a * a) * x;
  }
  return tall ? x.transpose() : x;
}

inline void muon(const Muon& o, const Eigen::MatrixXd& grad, Eigen::MatrixXd& param, Eigen::MatrixXd& m) {
  m = o.momentum * m + (1 - o.momentum) * grad;
  const Eigen::MatrixXd ahead = (1 - o.momentum) * grad + o.momentum * m;
  param *= 1 - o.lr * o.weight_decay;
  param -= o.lr * 0.2 * std::sqrt(static_cast<double>(std::max(param.rows(), param.cols()))) * orthogonal(ahead);
}

}  // namespace vsplat::ref
