#include "runtime/printable.h"

#include <gtest/gtest.h>

namespace vsplat {
namespace {

TEST(Printable, KeepsTextAndReplacesTheRest) {
  EXPECT_EQ(printable(""), "");
  EXPECT_EQ(printable("a\tb\x7f"), "a?b?");
  EXPECT_EQ(printable("\xc3\xa4 \xe5\x9c\x96 \xf0\x9f\x90\x8e"), "\xc3\xa4 \xe5\x9c\x96 \xf0\x9f\x90\x8e");
  EXPECT_EQ(printable("\xc3"), "?");
  EXPECT_EQ(printable("\xc3("), "?(");
  EXPECT_EQ(printable("\xc2\x9b[2J"), "??[2J");  // a terminal's control sequence
  EXPECT_EQ(printable("\xff\x80"), "??");
}

TEST(Printable, CutsBetweenCharacters) {
  EXPECT_EQ(printable(std::string(100, 'x')), std::string(100, 'x'));
  EXPECT_EQ(printable(std::string(101, 'x')), std::string(100, 'x') + "... (101 bytes)");
  EXPECT_EQ(printable(std::string(99, 'x') + "\xc3\xa4"), std::string(99, 'x') + "... (101 bytes)");
}

}  // namespace
}  // namespace vsplat
