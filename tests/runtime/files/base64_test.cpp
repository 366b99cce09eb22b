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

TEST(Base64, ComesBackAndRefusesDamage) {
  for (std::size_t n = 0; n < 7; ++n) {
    std::vector<unsigned char> bytes;
    bytes.reserve(n);
    for (std::size_t i = 0; i < n; ++i) bytes.push_back(static_cast<unsigned char>(251 * (i + 1)));
    const auto back = from_base64(base64(bytes));
    ASSERT_TRUE(back) << n;
    EXPECT_EQ(*back, bytes);
  }
  // Around the pieces in which long ones are converted.
  for (const std::size_t n : {(3u << 20) - 1, 3u << 20, (3u << 20) + 1, (6u << 20) + 2}) {
    std::vector<unsigned char> bytes(n);
    for (std::size_t i = 0; i < n; ++i) bytes[i] = static_cast<unsigned char>(i * i / 7);
    const std::string text = base64(bytes);
    ASSERT_EQ(text.size(), (n + 2) / 3 * 4);
    const std::size_t at = (std::size_t{3} << 20) - 6;
    EXPECT_EQ(text.substr(at / 3 * 4), base64({bytes.begin() + static_cast<std::ptrdiff_t>(at), bytes.end()})) << n;
    const auto back = from_base64(text);
    EXPECT_TRUE(back && *back == bytes) << n;
  }
  for (const char* bad : {"A", "AAA", "AAAAA", "AA=A", "A===", "AA\nA", " AAA", "AAA\x80"})
    EXPECT_FALSE(from_base64(bad)) << bad;
}

}  // namespace
}  // namespace vsplat
