// Convolutions over volumes for tests: random numbers, and every method of computing them.
#pragma once
#include <gtest/gtest.h>

#include "model/diagnose/selftest/inputs/random_convolutions.h"
#include "model/ops/dense/conv3d.h"
#include "tests/support/compare.h"
#include "tests/support/device.h"

namespace vsplat::test {

using selftest::ConvTry;
using selftest::make_conv_case;
using selftest::upload_rows;

struct ConvWay {
  Flavour flavour;
  ConvMethod method;
};

inline auto conv_ways() {
  return ::testing::Values(ConvWay{Flavour::cpu, ConvMethod::direct}, ConvWay{Flavour::cpu, ConvMethod::winograd},
                           ConvWay{Flavour::gpu, ConvMethod::direct}, ConvWay{Flavour::gpu, ConvMethod::winograd});
}
// The methods for the gradient by weights.
inline auto conv_weights_ways() {
  return ::testing::Values(ConvWay{Flavour::cpu, ConvMethod::direct}, ConvWay{Flavour::cpu, ConvMethod::winograd},
                           ConvWay{Flavour::gpu, ConvMethod::direct});
}

inline std::string name_of_way(const ::testing::TestParamInfo<ConvWay>& way) {
  return std::string(name_of(way.param.flavour)) + (way.param.method == ConvMethod::winograd ? "_winograd" : "_direct");
}

}  // namespace vsplat::test
