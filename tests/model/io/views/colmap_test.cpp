#include "model/io/views/colmap.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cstdint>
#include <cstring>

#include "model/io/views/view_set.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using test::expect_error;

struct PosedImage {
  std::uint32_t id, camera;
  std::string name;
  int points;
};

// Two cameras, three images, the same model as text and as bytes.
class Colmap : public ::testing::Test {
 protected:
  template <class T>
  static void put(std::string& out, T value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    out.append(bytes, sizeof value);
  }
  static std::array<double, 7> pose(std::uint32_t id) {
    const Camera c = test::ring(7, {1, 2, 3})[id % 7];
    const Eigen::Quaterniond q(Eigen::Matrix3d(c.w2c.topLeftCorner<3, 3>()));
    return {q.w(), q.x(), q.y(), q.z(), c.w2c(0, 3), c.w2c(1, 3), c.w2c(2, 3)};
  }
  void SetUp() override {
    put<std::uint64_t>(cameras_bin, 2);
    for (const std::uint32_t id : {7U, 2U}) {
      put(cameras_bin, id);
      put<std::int32_t>(cameras_bin, id == 7 ? 1 : 2);
      put<std::uint64_t>(cameras_bin, 640);
      put<std::uint64_t>(cameras_bin, 480);
      for (const double p :
           id == 7 ? std::vector<double>{800, 790, 322, 237} : std::vector<double>{700, 320, 240, 0.125})
        put(cameras_bin, p);
    }
    cameras_txt = "# a comment\n7 PINHOLE 640 480 800 790 322 237\r\n\n2 SIMPLE_RADIAL 640 480 700 320 240 0.125\n";
    put<std::uint64_t>(images_bin, images.size());
    images_txt = "# two lines an image\n";
    for (const PosedImage& image : images) {
      put(images_bin, image.id);
      images_txt += fmt::format("{}", image.id);
      for (const double v : pose(image.id)) put(images_bin, v), images_txt += fmt::format(" {:.17g}", v);
      put(images_bin, image.camera);
      images_bin += image.name + '\0';
      images_txt += fmt::format(" {} {}\n", image.camera, image.name);
      put<std::uint64_t>(images_bin, image.points);
      for (int i = 0; i < image.points; ++i) {
        put(images_bin, 1.5), put(images_bin, 2.5), put<std::int64_t>(images_bin, -1);
        images_txt += "1.5 2.5 -1 ";
      }
      images_txt += "\n";
    }
  }
  void write_binary(const std::string& at = "sparse/0/") {
    folder.write(at + "cameras.bin", cameras_bin);
    folder.write(at + "images.bin", images_bin);
  }
  void write_text(const std::string& at = "sparse/0/") {
    folder.write(at + "cameras.txt", cameras_txt);
    folder.write(at + "images.txt", images_txt);
  }
  ViewSet read() { return read_views(folder.path(), {.need_pictures = false}); }
  void expect_views(const ViewSet& set) {
    ASSERT_EQ(set.views.size(), 3U);
    EXPECT_EQ(set.convention, PoseConvention::opencv_w2c);
    const std::uint32_t ids[] = {5, 9, 1};  // in order of name
    for (int i = 0; i < 3; ++i) {
      const Camera& c = set.views[i].camera;
      EXPECT_LT((c.w2c - test::ring(7, {1, 2, 3})[ids[i] % 7].w2c).cwiseAbs().maxCoeff(), 1e-14);
      EXPECT_EQ(c.file, set.views[i].name);
      EXPECT_EQ(c.width, 640);
      EXPECT_TRUE(is_resolved(set.views[i]));
    }
    EXPECT_EQ(set.views[0].name, "a 1.jpg");
    EXPECT_EQ(set.views[1].name, "b.jpg");
    EXPECT_EQ(set.views[2].name, "left/a.jpg");
    const Camera &a = set.views[0].camera, &b = set.views[1].camera;
    EXPECT_EQ(a.fx, 700);
    EXPECT_EQ(a.fy, 700);
    EXPECT_EQ(a.cx, 320);
    EXPECT_EQ(a.distortion.model, Distortion::Model::opencv);
    EXPECT_EQ(a.distortion.k[0], 0.125);
    EXPECT_EQ(b.fx, 800);
    EXPECT_EQ(b.fy, 790);
    EXPECT_EQ(b.cy, 237);
    EXPECT_EQ(b.distortion.model, Distortion::Model::none);
  }

  std::vector<PosedImage> images = {{1, 7, "left/a.jpg", 2}, {9, 7, "b.jpg", 0}, {5, 2, "a 1.jpg", 1}};
  std::string cameras_bin, cameras_txt, images_bin, images_txt;
  test::ViewFolder folder;
};

TEST_F(Colmap, TextAndBinaryAgree) {
  write_text();
  expect_views(read());
  folder.write("sparse/0/images.txt", "damaged, and not read where there is a binary one");
  write_binary();
  const ViewSet set = read();
  expect_views(set);
  ASSERT_EQ(set.choices.size(), 1u);
  EXPECT_NE(set.choices[0].find("cameras.bin and images.bin are read"), std::string::npos) << set.choices[0];
}

TEST_F(Colmap, TextMayBeginWithAByteOrderMark) {
  for (std::string* text : {&cameras_txt, &images_txt}) text->insert(0, "\xef\xbb\xbf");
  write_text();
  expect_views(read());
}

TEST_F(Colmap, IsFoundWhereItMayBe) {
  for (const char* at : {"sparse/0/", "sparse/", "colmap/", ""}) {
    write_binary(at);
    expect_views(read());
    std::filesystem::remove_all(folder.path());
  }
}

TEST_F(Colmap, PicturesAndMasks) {
  write_binary();
  folder.touch("images/left/a.jpg");
  folder.touch("images/b.jpg");
  folder.touch("masks/left/a.png");
  folder.touch("masks/b.jpg.png");
  test::Warnings warnings;
  const ViewSet set = read_views(folder.path());
  ASSERT_EQ(warnings.all.size(), 1U);
  EXPECT_NE(warnings.all[0].find("1 of 3"), std::string::npos);
  const auto same = [](const std::filesystem::path& a, const std::filesystem::path& b) {
    return std::filesystem::exists(a) && std::filesystem::equivalent(a, b);
  };
  EXPECT_TRUE(set.views[0].picture.empty());
  EXPECT_TRUE(same(set.views[1].picture, folder / "images/b.jpg"));
  EXPECT_TRUE(same(set.views[2].picture, folder / "images/left/a.jpg"));
  EXPECT_TRUE(same(*set.views[1].mask, folder / "masks/b.jpg.png"));
  EXPECT_TRUE(same(*set.views[2].mask, folder / "masks/left/a.png"));
  std::filesystem::rename(folder / "images", folder / "photos");
  expect_error(Status::input, {"none of the 3", "a 1.jpg", "looked for", "give their folder (pictures)"},
               [&] { read_views(folder.path()); });
  EXPECT_TRUE(
      same(read_views(folder.path(), {.pictures_dir = folder / "photos"}).views[1].picture, folder / "photos/b.jpg"));
  EXPECT_TRUE(same(read_views(folder / "sparse/0/images.bin", {.pictures_dir = folder / "photos"}).views[1].picture,
                   folder / "photos/b.jpg"));
}

TEST_F(Colmap, EveryCameraModel) {
  struct Case {
    const char* text;
    Distortion::Model model;
    std::vector<double> k;
  };
  using enum Distortion::Model;
  for (const Case& c :
       {Case{"SIMPLE_PINHOLE 640 480 700 320 240", none, {}}, Case{"PINHOLE 640 480 700 710 320 240", none, {}},
        Case{"SIMPLE_RADIAL 640 480 700 320 240 .1", opencv, {.1}},
        Case{"RADIAL 640 480 700 320 240 .1 .2", opencv, {.1, .2}},
        Case{"OPENCV 640 480 700 710 320 240 .1 .2 .3 .4", opencv, {.1, .2, .3, .4}},
        Case{"OPENCV_FISHEYE 640 480 700 710 320 240 .1 .2 .3 .4", fisheye, {.1, .2, .3, .4}},
        Case{"FULL_OPENCV 640 480 700 710 320 240 .1 .2 .3 .4 .5 .6 .7 .8", opencv, {.1, .2, .3, .4, .5, .6, .7, .8}},
        Case{"SIMPLE_RADIAL_FISHEYE 640 480 700 320 240 .1", fisheye, {.1}},
        Case{"RADIAL_FISHEYE 640 480 700 320 240 .1 .2", fisheye, {.1, .2}}}) {
    write_text();
    folder.write("sparse/0/cameras.txt", fmt::format("7 {0}\n2 {0}\n", c.text));
    const Camera camera = read().views[0].camera;
    EXPECT_EQ(camera.distortion.model, c.model) << c.text;
    for (std::size_t i = 0; i < 8; ++i) EXPECT_EQ(camera.distortion.k[i], i < c.k.size() ? c.k[i] : 0.0) << c.text;
    EXPECT_EQ(camera.fx, 700) << c.text;
    EXPECT_EQ(camera.fy, std::string(c.text).find("710") != std::string::npos ? 710 : 700) << c.text;
    EXPECT_EQ(camera.cx, 320) << c.text;
    EXPECT_EQ(camera.cy, 240) << c.text;
  }
  for (const char* name : {"FOV", "THIN_PRISM_FISHEYE", "EUCM", "EQUIRECTANGULAR"}) {
    folder.write("sparse/0/cameras.txt", fmt::format("7 {0} 640 480 1 2 3 4 5\n2 {0} 640 480 1 2 3 4 5\n", name));
    expect_error(Status::input, {"line 2", "camera 2", name, "not supported", "a 1.jpg"}, [&] { read(); });
  }
}

TEST_F(Colmap, DamagedTextIsNamed) {
  const auto with = [&](const char* file, std::string text, const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
    return [this, file, text] {
      write_text();
      folder.write(std::string("sparse/0/") + file, text);
      read();
    };
  };
  expect_error(Status::format, {"cameras.txt: line 2", "PINHOL"},
               with("cameras.txt", cameras_txt, "PINHOLE", "PINHOL"));
  expect_error(Status::format, {"cameras.txt: line 2", "more than the 4"},
               with("cameras.txt", cameras_txt, "237", "237 1"));
  expect_error(Status::format, {"cameras.txt: line 2", "a number"}, with("cameras.txt", cameras_txt, "237", ""));
  expect_error(Status::input, {"focal length", "-800"}, with("cameras.txt", cameras_txt, "800", "-800"));
  expect_error(Status::input, {"parameter 0", "NaN"}, with("cameras.txt", cameras_txt, "800", "nan"));
  expect_error(Status::input, {"cameras.txt: line 4 (camera 2)", "coefficient k1 is 1e+300"},
               with("cameras.txt", cameras_txt, "0.125", "1e300"));
  expect_error(Status::format, {"NAME"}, with("images.txt", images_txt, "left/", std::string("le\0ft/", 6)));
  expect_error(Status::input, {"QW is infinity"},
               with("images.txt", images_txt, "\n9 ", "\n9 inf 0 0 0 0 0 0 7 a.jpg\n\n9 "));
  expect_error(Status::input, {"WIDTH is 1e+300"}, with("cameras.txt", cameras_txt, "640", "1e300"));
  expect_error(Status::format, {"camera 7", "twice"}, with("cameras.txt", cameras_txt, "2 SIMPLE", "7 SIMPLE"));
  expect_error(Status::format, {"images.txt: line 2", "left/a.jpg", "camera 8"},
               with("images.txt", images_txt, "7 left", "8 left"));
  expect_error(Status::format, {"images.txt: line 3", "points"}, with("images.txt", images_txt, "1.5 2.5 -1 \n", ""));
  // An image whose name contains blanks is not mistaken for a line of points, which would lose every other image.
  expect_error(Status::format, {"images.txt: line 2", "\"b\" where a number"}, [&] {
    write_text();
    folder.write("sparse/0/images.txt", "1 1 0 0 0 0 0 0 7 a (1) 2.jpg\n2 1 0 0 0 0 0 0 7 b (1) 2.jpg\n");
    read();
  });
  expect_error(Status::format, {"cameras.txt: line 4", "4 parameters f cx cy k", "ends after 3"},
               with("cameras.txt", cameras_txt, " 0.125", ""));
  expect_error(Status::input, {"quaternion"}, with("images.txt", images_txt, "\n9 ", "\n9 9"));
  expect_error(Status::input, {"lists no images"}, with("images.txt", images_txt, images_txt, "# none\n"));
}

TEST_F(Colmap, DamagedBytesNeverCrash) {
  const std::string good_cameras = cameras_bin, good_images = images_bin;
  for (std::size_t cut = 0; cut < good_images.size(); ++cut) {
    images_bin = good_images.substr(0, cut);
    write_binary();
    expect_error(Status::format, {"images.bin", "byte"}, [&] { read(); });
  }
  images_bin = good_images;
  for (std::size_t cut = 0; cut < good_cameras.size(); ++cut) {
    cameras_bin = good_cameras.substr(0, cut);
    write_binary();
    expect_error(Status::format, {"cameras.bin", "byte"}, [&] { read(); });
  }
  for (std::size_t bit = 0; bit < 8 * (good_cameras.size() + good_images.size()); bit += 7) {
    cameras_bin = good_cameras, images_bin = good_images;
    std::string& hit = bit < 8 * good_cameras.size() ? cameras_bin : images_bin;
    const std::size_t at = bit < 8 * good_cameras.size() ? bit : bit - 8 * good_cameras.size();
    hit[at / 8] = static_cast<char>(hit[at / 8] ^ (1 << (at % 8)));
    write_binary();
    try {
      EXPECT_EQ(read().views.size(), 3U);  // never silently fewer
    } catch (const Error&) {
    }
  }
  // Counts of cameras, of images and of the first image's points.
  for (const std::uint64_t count : {std::uint64_t{1} << 40, ~std::uint64_t{0}, std::uint64_t{1} << 63}) {
    const auto set = [&](std::string& in, std::size_t at) { std::memcpy(&in[at], &count, sizeof count); };
    cameras_bin = good_cameras, images_bin = good_images;
    set(cameras_bin, 0);
    write_binary();
    expect_error(Status::format, {"cameras.bin: byte 0", fmt::format("{} cameras cannot be in", count)},
                 [&] { read(); });
    cameras_bin = good_cameras;
    set(images_bin, 0);
    write_binary();
    expect_error(Status::format, {"images.bin: byte 0", fmt::format("{} images cannot be in", count)}, [&] { read(); });
    images_bin = good_images;
    const std::size_t points = 8 + 4 + 56 + 4 + images[0].name.size() + 1;
    set(images_bin, points);
    write_binary();
    expect_error(Status::format, {fmt::format("images.bin: byte {}: {} points cannot be in", points, count)},
                 [&] { read(); });
  }
  cameras_bin = good_cameras;
  images_bin = good_images + "x";
  write_binary();
  expect_error(Status::format, {"images.bin", "1 bytes follow"}, [&] { read(); });
}

TEST_F(Colmap, NamesInAnyCase) {
  const auto of = [&](const std::string& name, const std::string& sparse, const std::string& cameras,
                      const std::string& list) {
    folder.write(name + "/" + sparse + "/0/" + cameras, cameras_txt);
    folder.write(name + "/" + sparse + "/0/" + list, images_txt);
    for (const PosedImage& image : images) folder.touch(name + "/Images/" + image.name);
    return read_views(folder / name, {.tell = false});
  };
  const ViewSet plain = of("plain", "sparse", "cameras.txt", "images.txt");
  for (const auto& [sparse, cameras, list] :
       {std::array{"Sparse", "Cameras.txt", "Images.TXT"}, {"SPARSE", "CAMERAS.TXT", "images.txt"}}) {
    const ViewSet found = of(sparse, sparse, cameras, list);
    ASSERT_EQ(found.views.size(), plain.views.size());
    for (std::size_t i = 0; i < plain.views.size(); ++i) {
      EXPECT_EQ(found.views[i].name, plain.views[i].name);
      EXPECT_EQ(found.views[i].camera.w2c, plain.views[i].camera.w2c);
      EXPECT_FALSE(found.views[i].picture.empty());
    }
    EXPECT_EQ(read_views(folder / sparse / sparse / "0" / cameras, {.tell = false}).views.size(), plain.views.size());
  }
  folder.write("two/sparse/0/Cameras.txt", cameras_txt);
  folder.write("two/sparse/0/CAMERAS.txt", cameras_txt);
  folder.write("two/sparse/0/images.txt", images_txt);
  folder.touch("two/images/a.png");
  expect_error(Status::file, {"CAMERAS.txt and Cameras.txt", "cameras.txt", "keep one"},
               [&] { read_views(folder / "two"); });
}

}  // namespace
}  // namespace vsplat
