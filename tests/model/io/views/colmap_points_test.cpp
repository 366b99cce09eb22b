#include "model/io/views/colmap_points.h"

#include <fmt/format.h>

#include <cstdint>
#include <cstring>

#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using test::expect_error;

constexpr std::size_t record = 8 + 24 + 3 + 8 + 8;

// Three points with tracks of 2, 0 and 1, as text and as bytes, beside cameras and images that are not read.
class ColmapPoints : public ::testing::Test {
 protected:
  template <class T>
  static void put(std::string& out, T value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    out.append(bytes, sizeof value);
  }
  void SetUp() override {
    text = "# 3D point list\n#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[]\n";
    put<std::uint64_t>(binary, all.size());
    std::uint64_t id = 7;
    for (const ColoredPoint& p : all) {
      put<std::uint64_t>(binary, id);
      text += fmt::format("{}", id++);
      for (const double v : p.position) put(binary, v), text += fmt::format(" {:.17g}", v);
      for (const std::uint8_t c : p.rgb) put(binary, c), text += fmt::format(" {}", c);
      put(binary, p.error), text += fmt::format(" {:.17g}", p.error);
      put(binary, p.track);
      for (std::uint64_t i = 0; i < p.track; ++i)
        put<std::int32_t>(binary, 1), put<std::int32_t>(binary, 42), text += " 1 42";
      text += "\r\n\n";
    }
  }
  void write(const std::string& at, const char* ending, const std::string& points) const {
    folder.touch(at + "cameras" + ending);
    folder.touch(at + "images" + ending);
    folder.write(at + "points3D" + ending, points);
  }
  void expect_points(const std::filesystem::path& path) const {
    const std::vector<ColoredPoint> found = read_colmap_points(path);
    ASSERT_EQ(found.size(), all.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      EXPECT_EQ(found[i].position, all[i].position) << i;
      EXPECT_EQ(found[i].rgb, all[i].rgb) << i;
      EXPECT_EQ(found[i].error, all[i].error) << i;
      EXPECT_EQ(found[i].track, all[i].track) << i;
    }
  }

  std::vector<ColoredPoint> all = {{{0.1, -2.25, 1e6 + 1. / 3}, {255, 0, 17}, 0.25, 2},
                                   {{0, 1e-30, -4}, {1, 2, 3}, -1, 0},
                                   {{3, 2, 1}, {9, 200, 128}, 1.5, 1}};
  std::string binary, text;
  test::ViewFolder folder;
};

TEST_F(ColmapPoints, TextAndBinaryAgree) {
  write("sparse/0/", ".txt", text);
  expect_points(folder.path());
  folder.write("sparse/0/points3D.txt", "damaged, and not read where there is a binary one");
  write("sparse/0/", ".bin", binary);
  expect_points(folder.path());
}

TEST_F(ColmapPoints, AreFoundWhereTheCamerasAre) {
  for (const std::string at : {"sparse/0/", "sparse/", "colmap/", ""}) {
    write(at, ".bin", binary);
    expect_points(folder.path());
    expect_points(folder / (at + "images.bin"));
    folder.touch("transforms.json");
    expect_points(folder / "transforms.json");
    std::filesystem::remove(folder / (at + "points3D.bin"));
    expect_error(Status::file, {"points3D.bin or points3D.txt"}, [&] { read_colmap_points(folder.path()); });
    std::filesystem::remove_all(folder.path());
  }
  expect_error(Status::file, {"no COLMAP model", "sparse/0"}, [&] { read_colmap_points(folder.path()); });
  // A file of a model means that model, even if there is another one below.
  write("sparse/0/", ".bin", "damaged");
  write("", ".bin", binary);
  expect_points(folder / "cameras.bin");
}

TEST_F(ColmapPoints, DamagedTextIsNamed) {
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string bad = text;
    bad.replace(bad.find(from), from.size(), to);
    return [this, bad] {
      write("", ".txt", bad);
      read_colmap_points(folder.path());
    };
  };
  expect_error(Status::format, {"points3D.txt: line 3", "POINT3D_ID", "\"x7\""}, with("\n7 ", "\nx7 "));
  expect_error(Status::input, {"points3D.txt: line 3 (point 7)", "Y is NaN"}, with("-2.25", "nan"));
  expect_error(Status::input, {"line 3", "Y is 1e+300", "finite"}, with("-2.25", "1e300"));
  expect_error(Status::input, {"line 3", "R is 256", "0 to 255"}, with(" 255 ", " 256 "));
  expect_error(Status::input, {"line 3", "R is -1", "0 to 255"}, with(" 255 ", " -1 "));
  expect_error(Status::input, {"line 3", "ERROR is infinity"}, with("0.25 1 42", "inf 1 42"));
  expect_error(Status::format, {"line 3", "IMAGE_ID POINT2D_IDX", "3 words"}, with("1 42 1 42", "1 42 1"));
  expect_error(Status::format, {"line 7", "ERROR is \"\""}, with("128 1.5 1 42", "128"));
  write("", ".txt", "# none\n");
  expect_error(Status::input, {"points3D.txt", "no points"}, [&] { read_colmap_points(folder.path()); });
}

TEST_F(ColmapPoints, DamagedBytesAreNamed) {
  const auto refused = [&](const std::string& bytes, Status status, const std::vector<std::string>& parts) {
    write("", ".bin", bytes);
    expect_error(status, parts, [&] { read_colmap_points(folder.path()); });
  };
  for (std::size_t cut = 0; cut < binary.size(); ++cut)
    refused(binary.substr(0, cut), Status::format, {"points3D.bin", "byte"});
  refused(binary + "x", Status::format, {"points3D.bin", "1 bytes follow"});
  for (const std::uint64_t count : {std::uint64_t{4}, std::uint64_t{1} << 40, ~std::uint64_t{0}}) {
    std::string bad = binary;
    std::memcpy(bad.data(), &count, sizeof count);
    refused(bad, Status::format, {"points3D.bin: byte"});
    if (count > 4) refused(bad, Status::format, {fmt::format("byte 0: {} points cannot be in", count)});
    bad = binary;
    const std::size_t track = record;  // 8 of the count, then the record up to its last 8 bytes
    std::memcpy(bad.data() + track, &count, sizeof count);
    if (count > 4) refused(bad, Status::format, {fmt::format("byte {}: {} observations cannot be in", track, count)});
  }
  const double nan = std::nan("");
  std::string bad = binary;
  std::memcpy(bad.data() + 8 + 8 + 8, &nan, sizeof nan);
  refused(bad, Status::input, {"points3D.bin: point 7", "Y is", "NaN"});
  bad = binary;
  std::memcpy(bad.data() + 8 + 8 + 24 + 3, &nan, sizeof nan);
  refused(bad, Status::input, {"points3D.bin: point 7", "ERROR is", "NaN"});
  refused(std::string(8, '\0'), Status::input, {"points3D.bin", "no points"});
}

}  // namespace
}  // namespace vsplat
