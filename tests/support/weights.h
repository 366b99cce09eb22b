// Comparing weights that must be equal to the bit.
#pragma once
#include <gtest/gtest.h>

#include <cstring>

#include "model/networks/params/weights.h"

namespace vsplat::test {

inline void expect_equal(const Weights& a, const Weights& b) {
  ASSERT_EQ(a.all().size(), b.all().size());
  for (const auto& [name, tensor] : a.all()) {
    EXPECT_EQ(tensor.shape, b.at(name).shape) << name;
    ASSERT_EQ(tensor.data.size(), b.at(name).data.size()) << name;
    EXPECT_EQ(std::memcmp(tensor.data.data(), b.at(name).data.data(), tensor.data.size() * 4), 0) << name;
  }
}

}  // namespace vsplat::test
