#include "runtime/json_text.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/refusal.h"

namespace vsplat {
namespace {

std::string nested(int depth) {
  return std::string(static_cast<std::size_t>(depth), '[') + std::string(static_cast<std::size_t>(depth), ']');
}

TEST(JsonText, GivesWhatIsThere) {
  const nlohmann::json found =
      parse_json("a", R"({"a": [1, -2, 2.5, true, null, "x"], "b": {"a": {"a": 18446744073709551615}}})");
  EXPECT_EQ(found.dump(), R"({"a":[1,-2,2.5,true,null,"x"],"b":{"a":{"a":18446744073709551615}}})");
}

TEST(JsonText, RefusesWhatIsTooDeep) {
  EXPECT_NO_THROW(parse_json("a", nested(33), 32));
  for (const std::string& text : {nested(34), nested(300'000), std::string(300'000, '[')})
    test::expect_error(Status::format, {"file.json", "nested deeper than 32 levels"},
                       [&] { parse_json("file.json", text); });
  test::expect_error(Status::format, {"nested deeper than 1 levels"}, [] { parse_json("a", R"({"a": {"b": 1}})", 1); });
  EXPECT_NO_THROW(parse_json("a", R"({"a": 1})", 1));
}

TEST(JsonText, RefusesAFieldThatIsThereTwice) {
  for (const char* text : {R"({"a": 1, "a": 1})", R"({"b": [{"a": 1, "c": {"a": 2}, "a": {}}]})"})
    test::expect_error(Status::format, {"file.json", "field a twice"}, [&] { parse_json("file.json", text); });
  EXPECT_NO_THROW(parse_json("a", R"([{"a": 1}, {"a": {"a": 1}}])"));
}

TEST(JsonText, SaysWhereItIsNone) {
  for (const char* text : {"", "{", "[1,]", "[1] 2", "{\"a\": \"\xff\"}", "\x1b[2J", "nul"})
    test::expect_error(Status::format, {"file.json: is not valid JSON"}, [&] { parse_json("file.json", text); });
  for (const char* number : {"1e999", "-1e400"})
    test::expect_error(Status::format, {"file.json: byte 6: the number " + std::string(number) + " is too large"},
                       [&] { parse_json("file.json", "{\"a\": " + std::string(number) + "}"); });
}

// Regression: for each of some ten thousand members all of them were visited, which took minutes.
TEST(JsonText, TakesTimeByItsLength) {
  std::string objects = "{", lists = "[";
  for (int i = 0; i < 200'000; ++i) {
    objects += (i ? ",\"" : "\"") + std::to_string(i) + "\":{\"shape\":[]}";
    lists += i ? ",[{}]" : "[{}]";
  }
  EXPECT_EQ(parse_json("a", objects + "}").size(), 200'000u);
  EXPECT_EQ(parse_json("a", lists + "]").size(), 200'000u);
}

}  // namespace
}  // namespace vsplat
