#include "runtime/message_text.h"

#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "runtime/error.h"
#include "runtime/fail.h"
#include "runtime/log.h"

namespace vsplat {
namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <class... Args>
std::string text(fmt::format_string<Args...> format, Args&&... args) {
  return message_text(format, fmt::make_format_args(args...));
}

TEST(MessageText, NamesNumbersThatAreNotFinite) {
  EXPECT_EQ(text("{}: fx is {}", "a.json", nan), "a.json: fx is NaN");
  EXPECT_EQ(text("{}", std::copysign(nan, -1.0)), "NaN");  // fmt: -nan
  EXPECT_EQ(text("{:.2f} {:>9.3g} {:g}", nan, infinite, -infinite), "NaN infinity -infinity");
  EXPECT_EQ(text("{1} {0}", std::numeric_limits<float>::infinity(), 1), "1 infinity");
  EXPECT_EQ(number_text(-infinite), "-infinity");
}

TEST(MessageText, OtherArgumentsAreFormattedAsTheyAre) {
  EXPECT_EQ(text("{:.2f} {} {:>3} {}", 1.0 / 3, 2.5f, 7, std::string("nan")), "0.33 2.5   7 nan");
  EXPECT_EQ(text("{:.2f} {} {:>3} {}", 1.0 / 3, nan, 7, fmt::join(std::vector<int>{1, 2}, ",")), "0.33 NaN   7 1,2");
  EXPECT_EQ(text("{}{}{}{}{}{}{}{}{}{}{}{}{}{}{}{}{}", 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16, nan),
            "12345678910111213141516NaN");
  EXPECT_EQ(number_text(0.1), "0.1");
}

TEST(MessageText, ErrorsAndTheLogUseIt) {
  try {
    fail(Status::input, "the edge is {}", nan);
  } catch (const Error& e) {
    EXPECT_STREQ(e.what(), "the edge is NaN");
  }
  std::string logged;
  set_log_sink([&](LogLevel, const std::string& line) { logged = line; });
  warn("the edge is {:.3f}", -infinite);
  set_log_sink({});
  EXPECT_EQ(logged, "the edge is -infinity");
}

}  // namespace
}  // namespace vsplat
