#include "runtime/files/base64.h"

#include <gtest/gtest.h>

namespace vsplat {
namespace {

std::string of(const std::string& text) { return base64({text.begin(), text.end()}); }

TEST(Base64, IsThatOfTheStandard) {  // RFC 4648, section 10, and digits 62 and 63
  EXPECT_EQ(of(""), "");
  EXPECT_EQ(of("f"), "Zg==");
  EXPECT_EQ(of("fo"), "Zm8=");
  EXPECT_EQ(of("foo"), "Zm9v");
  EXPECT_EQ(of("foob"), "Zm9vYg==");
  EXPECT_EQ(of("foobar"), "Zm9vYmFy");
  EXPECT_EQ(of("\xfb\xff\xbf"), "+/+/");
}

}  // namespace
}  // namespace vsplat
