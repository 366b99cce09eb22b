#include "runtime/system/ranks.h"

#include <gtest/gtest.h>

#include "runtime/error.h"

namespace vsplat {
namespace {

struct Two {
  int a;
  double b;
};

TEST(Messages, WhatGoesInComesOut) {
  MessageOut out;
  out.add(7).add(std::string("a text")).add(Two{1, 0.5}).add(std::vector<float>{1.5f, -2}).add(std::string());
  MessageIn in(out.bytes());
  EXPECT_EQ(in.take<int>(), 7);
  EXPECT_EQ(in.take_text(), "a text");
  const Two two = in.take<Two>();
  EXPECT_EQ(two.a, 1);
  EXPECT_EQ(two.b, 0.5);
  EXPECT_EQ(in.take_floats(), (std::vector<float>{1.5f, -2}));
  EXPECT_EQ(in.take_text(), "");
  EXPECT_THROW(in.take<char>(), Error);
}

TEST(Messages, WhatIsCutOffIsAnError) {
  MessageOut out;
  out.add(std::vector<float>(9, 1));
  for (std::size_t size = 0; size < out.bytes().size(); ++size) {
    MessageIn in(Ranks::Bytes(out.bytes().begin(), out.bytes().begin() + static_cast<std::ptrdiff_t>(size)));
    EXPECT_THROW(in.take_floats(), Error) << size;
  }
}

TEST(Ranks, AloneIsTheFirst) {  // mpirun starts no test
  Ranks& ranks = Ranks::world();
  EXPECT_EQ(ranks.rank(), 0);
  EXPECT_EQ(ranks.count(), 1);
  Ranks::Bytes bytes{1, 2};
  ranks.broadcast(bytes);
  EXPECT_EQ(bytes, (Ranks::Bytes{1, 2}));
}

}  // namespace
}  // namespace vsplat
