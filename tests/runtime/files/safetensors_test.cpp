#include "runtime/files/safetensors.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <span>

#include "runtime/error.h"
#include "runtime/files/sha256.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

using test::contents_of;
using test::put_file;
using test::TemporaryFolder;

// A file with this header, valid or not, and so many bytes of values.
std::string file_of(const std::string& header, std::size_t values) {
  const std::uint64_t length = header.size();
  return std::string(reinterpret_cast<const char*>(&length), 8) + header + std::string(values, '\x01');
}

class SafetensorsTest : public ::testing::Test {
 protected:
  std::string write(const std::string& content) {
    const std::string path = folder_.path("file.safetensors");
    put_file(path, content);
    return path;
  }

  // The error message for this content; the test fails if there is no error.
  std::string refusal(const std::string& content) {
    const std::string path = write(content);
    try {
      const SafetensorsFile file(path);
    } catch (const Error& e) {
      EXPECT_EQ(e.status(), Status::format) << e.what();
      EXPECT_NE(std::string(e.what()).find(path), std::string::npos) << e.what();
      return e.what();
    }
    ADD_FAILURE() << "accepted: " << content.substr(8, 200);
    return "";
  }

  TemporaryFolder folder_;
};

TEST_F(SafetensorsTest, ReturnsWhatWasWritten) {
  const std::vector<float> values = {1.5f, -2.0f, 3.25f, 0.0f, std::numeric_limits<float>::infinity(), 1e-40f};
  const std::vector<std::int64_t> numbers = {-1, 1LL << 40};
  const std::string path = folder_.path("a.safetensors");
  write_safetensors(path,
                    {{"b", Dtype::f32, {2, 3}, values.data()},
                     {"empty", Dtype::f32, {0, 3}, nullptr},
                     {"a", Dtype::i64, {2}, numbers.data()},
                     {"scalar", Dtype::f32, {}, values.data()}},
                    {{"note", "caf\xc3\xa9 \"quoted\""}});
  const SafetensorsFile file(path);
  ASSERT_EQ(file.tensors().size(), 4u);
  EXPECT_EQ(file.tensors()[0].name, "b");
  EXPECT_EQ(file.at("b").shape, (Shape{2, 3}));
  EXPECT_EQ(file.floats(file.at("b")), values);
  EXPECT_EQ(file.integers(file.at("a")), numbers);
  EXPECT_EQ(file.floats(file.at("scalar")), std::vector<float>{1.5f});
  EXPECT_EQ(file.at("empty").shape, (Shape{0, 3}));
  EXPECT_TRUE(file.floats(file.at("empty")).empty());
  EXPECT_EQ(file.metadata().at("note"), "caf\xc3\xa9 \"quoted\"");
  EXPECT_EQ(file.at("b").offset % 8, 0u);
  EXPECT_EQ(file.check_hash(), HashState::absent);
  EXPECT_EQ(file.find("c"), nullptr);
  EXPECT_THROW(file.at("c"), Error);
  EXPECT_THROW(file.integers(file.at("b")), Error);
}

TEST_F(SafetensorsTest, FromMemoryAsFromAFile) {
  const std::vector<float> values = {1.5f, -2.0f, 3.25f};
  const std::string path = folder_.path("a.safetensors");
  write_safetensors(path, {{"empty", Dtype::f32, {0}, nullptr}, {"v", Dtype::f32, {3}, values.data()}},
                    {{"key", "value"}}, true);
  std::string content = contents_of(path);
  const SafetensorsFile file("some memory", std::as_bytes(std::span(content)));
  EXPECT_EQ(file.bytes(), content.size());
  EXPECT_EQ(file.metadata().at("key"), "value");
  EXPECT_EQ(file.floats(file.at("v")), values);
  EXPECT_TRUE(file.floats(file.at("empty")).empty());
  EXPECT_EQ(file.check_hash(), HashState::matches);
  content.back() = static_cast<char>(content.back() ^ 1);
  EXPECT_EQ(file.check_hash(), HashState::differs);
}

TEST_F(SafetensorsTest, DamageInMemoryIsNamedToo) {
  const std::string whole = file_of(R"({"v":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}})", 8);
  for (std::size_t bytes = 0; bytes < whole.size(); ++bytes) {
    // A copy of exactly this size, so that the sanitizers detect reads beyond it.
    const std::vector<char> cut(whole.begin(), whole.begin() + static_cast<long>(bytes));
    try {
      const SafetensorsFile file("some memory", std::as_bytes(std::span(cut)));
      ADD_FAILURE() << bytes << " bytes accepted";
    } catch (const Error& e) {
      EXPECT_EQ(e.status(), Status::format) << e.what();
      EXPECT_EQ(std::string(e.what()).find("some memory"), 0u) << e.what();
    }
  }
}

TEST_F(SafetensorsTest, TheSameTensorsGiveTheSameBytes) {
  const std::vector<float> values = {1, 2, 3};
  for (const char* name : {"a", "b"})
    write_safetensors(folder_.path(name), {{"x", Dtype::f32, {3}, values.data()}}, {{"k", "v"}}, true);
  EXPECT_EQ(contents_of(folder_.path("a")), contents_of(folder_.path("b")));
  EXPECT_EQ(folder_.entries(), (std::vector<std::string>{"a", "b"}));  // and no temporary file stays
}

TEST_F(SafetensorsTest, ConvertsEveryDtype) {
  const std::uint16_t half[] = {0x3c00, 0xc000, 0x0001, 0x83ff, 0x7c00, 0xfc00, 0x7bff, 0x8000};
  const std::vector<float> halves = {
      1.0f, -2.0f, std::ldexp(1.0f, -24), -std::ldexp(1023.0f, -24), INFINITY, -INFINITY, 65504.0f, -0.0f};
  const std::uint16_t brain[] = {0x3f80, 0xc000, 0x7f80, 0x0001};
  const double wide[] = {0.1, -1e300};
  const std::int32_t ints[] = {-7, 1 << 24};
  const std::uint8_t bytes[] = {0, 255};
  const std::string path = folder_.path("d.safetensors");
  write_safetensors(path, {{"half", Dtype::f16, {8}, half},
                           {"brain", Dtype::bf16, {4}, brain},
                           {"wide", Dtype::f64, {2}, wide},
                           {"ints", Dtype::i32, {2}, ints},
                           {"bytes", Dtype::u8, {2}, bytes},
                           {"nan", Dtype::f16, {1}, &half[4]}});
  const SafetensorsFile file(path);
  const auto read_halves = file.floats(file.at("half"));
  for (std::size_t i = 0; i < halves.size(); ++i)
    EXPECT_EQ(std::bit_cast<std::uint32_t>(read_halves[i]), std::bit_cast<std::uint32_t>(halves[i])) << i;
  EXPECT_EQ(file.floats(file.at("brain")), (std::vector<float>{1.0f, -2.0f, INFINITY, std::ldexp(1.0f, -133)}));
  EXPECT_EQ(file.floats(file.at("wide")), (std::vector<float>{0.1f, -INFINITY}));
  EXPECT_EQ(file.floats(file.at("ints")), (std::vector<float>{-7.0f, 16777216.0f}));
  EXPECT_EQ(file.integers(file.at("bytes")), (std::vector<std::int64_t>{0, 255}));
}

TEST_F(SafetensorsTest, EveryHalfIsExact) {
  std::vector<std::uint16_t> all(1 << 16);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::uint16_t>(i);
  const std::string path = folder_.path("h.safetensors");
  write_safetensors(path, {{"h", Dtype::f16, {1 << 16}, all.data()}});
  const SafetensorsFile file(path);
  const std::vector<float> values = file.floats(file.at("h"));
  for (std::size_t i = 0; i < all.size(); ++i) {
    const int exponent = static_cast<int>(i >> 10 & 31), fraction = static_cast<int>(i & 1023);
    if (exponent == 31 && fraction != 0) {
      EXPECT_TRUE(std::isnan(values[i]));
      continue;
    }
    double expected = exponent == 31  ? INFINITY
                      : exponent == 0 ? std::ldexp(fraction, -24)
                                      : std::ldexp(1024 + fraction, exponent - 25);
    if (i >> 15) expected = -expected;
    EXPECT_EQ(static_cast<double>(values[i]), expected) << i;
  }
}

TEST_F(SafetensorsTest, HashCoversTheWholeFile) {
  EXPECT_EQ(Sha256().hex(), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  const std::vector<float> values = {1, 2, 3};
  const std::string path = folder_.path("x");
  // A value, a key and a tensor that look like the hash's own entry must not be taken for it.
  write_safetensors(path, {{"sha256", Dtype::f32, {3}, values.data()}},
                    {{"a", "\"sha256\":\"" + std::string(64, '0') + "\""}, {"zz", "sha256"}}, true);
  EXPECT_EQ(SafetensorsFile(path).check_hash(), HashState::matches);
  std::string content = contents_of(path);
  const std::string digest = SafetensorsFile(path).metadata().at("sha256");
  std::string blank = content;
  blank.replace(blank.find(digest), 64, 64, '0');
  Sha256 hash;
  hash.add(blank.data(), blank.size());
  EXPECT_EQ(hash.hex(), digest);
  content.back() ^= 1;
  EXPECT_EQ(SafetensorsFile(write(content)).check_hash(), HashState::differs);
}

TEST_F(SafetensorsTest, RefusesAHashThatIsNone) {
  for (const std::string& stated : {std::string("12"), std::string(64, 'g'), std::string(65, '0')})
    EXPECT_THROW(SafetensorsFile(write(file_of("{\"__metadata__\":{\"sha256\":\"" + stated + "\"}}", 0))).check_hash(),
                 Error);
  // With an escape in the text, the position of the digits is unknown.
  EXPECT_THROW(
      SafetensorsFile(write(file_of("{\"__metadata__\":{\"sha\\u003256\":\"" + std::string(64, '0') + "\"}}", 0)))
          .check_hash(),
      Error);
}

TEST_F(SafetensorsTest, AcceptsWhatOthersWrite) {
  // Entries in another order than their values, blanks in the header, no metadata.
  const std::string header =
      R"( { "b" : {"shape":[2],"dtype":"U8","data_offsets":[4,6]}, "a":{"dtype":"F32","shape":[1],"data_offsets":[0,4]} }  )";
  const SafetensorsFile file(write(file_of(header, 6)));
  EXPECT_EQ(file.tensors()[0].name, "a");
  EXPECT_EQ(file.integers(file.at("b")), (std::vector<std::int64_t>{1, 1}));
  EXPECT_TRUE(SafetensorsFile(write(file_of("{}", 0))).tensors().empty());
}

TEST_F(SafetensorsTest, RefusesDamagedHeadersByName) {
  const auto entry = [](const std::string& dtype, const std::string& shape, const std::string& offsets) {
    return "\"x\":{\"dtype\":" + dtype + ",\"shape\":" + shape + ",\"data_offsets\":" + offsets + "}";
  };
  const std::string good = entry("\"F32\"", "[1]", "[0,4]");
  struct Case {
    std::string header;
    std::size_t values;
    std::string word;  // must be in the message
  };
  const Case cases[] = {
      {"", 0, "JSON"},
      {"[1]", 0, "array"},
      {"{" + good, 4, "JSON"},
      {"{\"x\xff\":1}", 0, "JSON"},
      {"{" + good + "," + good + "}", 4, "x twice"},
      {"{\"a\":[[[[[1]]]]]}", 0, "deep"},
      {"{\"__metadata__\":[]}", 0, "__metadata__"},
      {"{\"__metadata__\":{\"k\":1}}", 0, "__metadata__ k"},
      {"{\"x\":3}", 0, "tensor x"},
      {"{\"x\":{\"dtype\":\"F32\",\"shape\":[1]}}", 4, "no field data_offsets"},
      {"{\"x\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[0,4],\"extra\":1}}", 4, "extra"},
      {"{" + entry("\"F33\"", "[1]", "[0,4]") + "}", 4, "F33"},
      {"{" + entry("1", "[1]", "[0,4]") + "}", 4, "dtype"},
      {"{" + entry("\"F32\"", "3", "[0,4]") + "}", 4, "shape"},
      {"{" + entry("\"F32\"", "[-1]", "[0,4]") + "}", 4, "-1"},
      {"{" + entry("\"F32\"", "[1.0]", "[0,4]") + "}", 4, "1.0"},
      {"{" + entry("\"F32\"", "[9223372036854775807,9223372036854775807]", "[0,4]") + "}", 4, "beyond"},
      {"{" + entry("\"F32\"", "[0,9223372036854775807,9223372036854775807]", "[0,0]") + "}", 0, "beyond"},
      {"{" + entry("\"F32\"", "[18446744073709551615]", "[0,4]") + "}", 4, "18446744073709551615"},
      {"{" + entry("\"F32\"", "[2]", "[0,4]") + "}", 4, "expected 8"},
      {"{" + entry("\"F32\"", "[1]", "[4,0]") + "}", 4, "expected 4"},
      {"{" + entry("\"F32\"", "[1]", "[0,4,8]") + "}", 4, "data_offsets"},
      {"{" + entry("\"F32\"", "[1]", "[-4,0]") + "}", 4, "-4"},
      {"{" + entry("\"F32\"", "[1]", "[4,8]") + "}", 8, "hole"},
      {"{" + good + ",\"y\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[2,6]}}", 6, "overlap"},
      {"{" + good + ",\"y\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[0,4]}}", 4, "overlap"},
      {"{" + good + "}", 3, "cut off"},
      {"{" + good + "}", 5, "5 bytes of values, expected 4"},
  };
  for (const Case& c : cases) {
    const std::string message = refusal(file_of(c.header, c.values));
    EXPECT_NE(message.find(c.word), std::string::npos) << message << "\nfor " << c.header;
  }
}

TEST_F(SafetensorsTest, RefusesImpossibleLengths) {
  EXPECT_NE(refusal("").find("too short"), std::string::npos);
  EXPECT_NE(refusal("1234567").find("too short"), std::string::npos);
  EXPECT_NE(refusal(std::string("\x05\0\0\0\0\0\0\0{}", 10)).find("cut off"), std::string::npos);
  EXPECT_NE(refusal(std::string(20, '\xff')).find("at most 100000000"), std::string::npos);
}

TEST_F(SafetensorsTest, NamesAFileThatCannotBeRead) {
  for (const std::string& path : {folder_.path("none"), folder_.path(".")}) {
    test::expect_error(Status::file, {path}, [&] { const SafetensorsFile file(path); });
  }
}

TEST_F(SafetensorsTest, LongAndStrangeNamesDoNotFloodMessages) {
  const std::string message = refusal(file_of("{\"" + std::string(100000, 'n') + "\\u0007\":1}", 0));
  EXPECT_LT(message.size(), 500u);
}

TEST_F(SafetensorsTest, WritesNothingIntoAFolderThatIsNotThere) {
  EXPECT_THROW(write_safetensors(folder_.path("none/x"), {}), Error);
  EXPECT_TRUE(folder_.entries().empty());
}

}  // namespace
}  // namespace vsplat
