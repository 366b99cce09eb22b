// Damaged SPZ files: errors that name the field and its byte.
#include "model/io/scene/spz.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>

#include "model/io/scene/spz_container.h"
#include "tests/support/golden_file.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

std::string fixture(const std::string& name) { return test::contents_of(test::golden_file("scenes/" + name)); }

Scene read(const std::string& bytes, SkippedGaussians* skipped = nullptr) {
  return read_spz("a.spz", std::as_bytes(std::span(bytes)), skipped);
}

std::string gzipped(const std::string& data) {
  std::string out(data.size() + 200, '\0');
  z_stream stream{};
  deflateInit2(&stream, 9, Z_DEFLATED, 16 + MAX_WBITS, 9, Z_DEFAULT_STRATEGY);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(data.data()));
  stream.avail_in = static_cast<uInt>(data.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(out.size() - stream.avail_out);
  deflateEnd(&stream);
  return out;
}

template <class T>
std::string with(std::string bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
  return bytes;
}

void expect_refused(const std::string& bytes, std::vector<std::string> words) {
  words.emplace_back("a.spz");
  test::expect_error(Status::format, words, [&] { read(bytes); });
}

// An old header and `count` Gaussians of zeros.
std::string old_file(std::uint32_t version, std::uint32_t count, std::size_t bytes) {
  std::string out = "NGSP";
  out.resize(16 + bytes);
  out = with(with(out, 4, version), 8, count);
  return out;
}

TEST(Spz, NewHeadersAreChecked) {
  const std::string good = fixture("version4_degree1.spz");
  EXPECT_EQ(read(good).gaussians.count, 7u);
  expect_refused(good.substr(0, 31), {"31 bytes", "32"});
  expect_refused(with(good, 0, 'X'), {"byte 0", "NGSP"});
  expect_refused(with(good, 4, std::uint32_t{5}), {"version (byte 4", "5", "1 to 4"});
  expect_refused(with(good, 4, std::uint32_t{3}), {"version 3", "without gzip"});
  expect_refused(with(good, 8, std::uint32_t{0}), {"count (byte 8", "0 Gaussians"});
  expect_refused(with(good, 8, std::uint32_t{0xffffffff}), {"count (byte 8", "4294967295"});
  expect_refused(with(good, 8, std::uint32_t{8}),
                 {"positions", "63 bytes decompressed (byte 40)", "8 Gaussians need 72"});
  expect_refused(with(good, 12, std::uint8_t{5}), {"SH degree (byte 12", "5", "0 to 4"});
  expect_refused(with(good, 13, std::uint8_t{25}), {"fractional bits (byte 13", "25"});
  expect_refused(with(good, 15, std::uint8_t{5}), {"streams (byte 15)", "5", "6 are expected"});
  expect_refused(with(good, 16, std::uint32_t{0xfffffff0}), {"table of contents (byte 16)", "4294967280"});
  expect_refused(with(good, 32, ~std::uint64_t{0}), {"positions", "(byte 32)", "cut off"});
  expect_refused(with(good, 40, ~std::uint64_t{0}), {"positions", "(byte 40)", "need 63"});
  expect_refused(good.substr(0, good.size() - 1), {"spherical harmonics", "cut off"});
  expect_refused(with(good, 32 + 6 * 16, 'x'), {"positions (byte 128)", "zstd"});
}

TEST(Spz, BytesAfterTheEndAreToldOf) {
  const test::Warnings warnings;
  read(fixture("version4_degree0.spz") + "more");
  ASSERT_EQ(warnings.all.size(), 1u);
  EXPECT_NE(warnings.all[0].find("4 bytes after the last stream"), std::string::npos) << warnings.all[0];
}

TEST(Spz, ExtensionsAreChecked) {
  const std::string good = fixture("frame6.spz");
  expect_refused(with(good, 36, std::uint32_t{400}), {"extension record (byte 0", "cut off"});
  expect_refused(with(good, 52, std::uint32_t{9}), {"coordinate system 9", "1 to 8"});
  expect_refused(with(good, 52, std::uint32_t{0}), {"coordinate system 0"});
  EXPECT_EQ(read(with(good, 44, std::uint32_t{7})).gaussians.count, 7u) << "unknown extensions are skipped";
}

TEST(Spz, OldHeadersAreChecked) {
  EXPECT_EQ(read(gzipped(old_file(2, 3, 3 * 19))).gaussians.count, 3u);
  expect_refused(gzipped("NGSP").substr(0, 20), {"gzip data", "cut off or damaged"});
  expect_refused(gzipped("NGSP"), {"4 bytes", "16"});
  expect_refused(gzipped("a file that is something else"), {"byte 0", "NGSP"});
  expect_refused(gzipped(old_file(4, 3, 60)), {"version 4", "1 to 3"});
  expect_refused(gzipped(old_file(3, 3, 3 * 20 - 1)), {"rotations", "12 bytes expected from byte 64", "11 are there"});
  expect_refused(gzipped(old_file(2, 0x7fffffff, 100)), {"count (byte 8", "2147483647"});
  // Few bytes that would become many.
  expect_refused(gzipped(old_file(3, 400000000, 1000)), {"400000000 Gaussians, which no file of"});
  expect_refused(gzipped(old_file(3, 400000, 1000)), {"positions: 3600000 bytes expected from byte 16", "1000 are"});
}

TEST(Spz, PositionsOfVersionOneMayBeBad) {
  std::string file = old_file(1, 3, 3 * 16);
  file = with(file, 16 + 6 + 2, std::uint16_t{0x7e00});  // NaN, in Gaussian 1
  expect_refused(gzipped(file), {"Gaussian 1, position 1 (byte 24", "NaN", "finite"});
  SkippedGaussians skipped;
  const test::Warnings warnings;
  EXPECT_EQ(read(gzipped(file), &skipped).gaussians.count, 2u);
  EXPECT_EQ(skipped.not_finite, 1u);
  EXPECT_NE(warnings.text().find("1 of 3 Gaussians"), std::string::npos);
}

// All sizes of rotations, also those that no unit quaternion has, give rotations of length 1.
TEST(Spz, RotationsAreNormalised) {
  for (const std::uint32_t word : {0u, 0xffffffffu, 0x1ffu | 0x1ff << 10 | 0x1ff << 20, 0xC0000000u}) {
    std::string file = old_file(3, 1, 20);
    const Gaussians g = read(gzipped(with(file, 16 + 16, word))).gaussians;
    float norm = 0;
    for (const float q : g.quats) norm += q * q;
    EXPECT_NEAR(norm, 1, 1e-5) << word;
  }
}

TEST(Spz, OnlyVersionsTwoToFourAreWritten) {
  Scene scene = read(fixture("version4_degree1.spz"));
  const test::TemporaryFolder folder;
  for (const int version : {1, 5})
    test::expect_error(Status::usage, {"SPZ version", "2 to 4"}, [&] { write_spz(folder / "a.spz", scene, version); });
  EXPECT_TRUE(folder.entries().empty());
}

}  // namespace
}  // namespace vsplat
