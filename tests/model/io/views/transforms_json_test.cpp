#include <fmt/format.h>

#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "model/io/views/view_set.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using nlohmann::json;
using test::expect_error;

json matrix_of(const Camera& camera) {  // as in the format: camera-to-world, OpenGL axes
  Eigen::Matrix4d m = camera.w2c.inverse();
  m.middleCols<2>(1) *= -1;
  json out = json::array();
  for (int r = 0; r < 4; ++r) out.push_back({m(r, 0), m(r, 1), m(r, 2), m(r, 3)});
  return out;
}

json sample(int count) {
  json root = {{"fl_x", 800.0}, {"fl_y", 790.0}, {"cx", 322.0}, {"cy", 237.0}, {"w", 640.0}, {"h", 480}};
  root["frames"] = json::array();
  for (const Camera& c : test::ring(count, {1, 2, 3}))
    root["frames"].push_back({{"file_path", "images/" + c.file}, {"transform_matrix", matrix_of(c)}});
  return root;
}

class TransformsJson : public ::testing::Test {
 protected:
  ViewSet read(const json& root, bool pictures = false) { return read_text(root.dump(1), pictures); }
  ViewSet read_text(const std::string& text, bool pictures = false) {
    return read_views(folder.write("transforms.json", text), {.need_pictures = pictures});
  }
  test::ViewFolder folder;
};

TEST_F(TransformsJson, PosesBecomeOpenCvWorldToCamera) {
  const auto cameras = test::ring(5, {1, 2, 3});
  const ViewSet set = read(sample(5));
  ASSERT_EQ(set.views.size(), 5U);
  EXPECT_EQ(set.convention, PoseConvention::opengl_c2w);
  for (int i = 0; i < 5; ++i) {
    const Camera& c = set.views[i].camera;
    EXPECT_LT((c.w2c - cameras[i].w2c).cwiseAbs().maxCoeff(), 1e-14);
    EXPECT_EQ(c.file, fmt::format("images/{}.png", i));
    EXPECT_EQ(c.width, 640);
    EXPECT_EQ(c.height, 480);
    EXPECT_EQ(c.fx, 800);
    EXPECT_EQ(c.fy, 790);
    EXPECT_EQ(c.cx, 322);
    EXPECT_EQ(c.cy, 237);
    EXPECT_EQ(c.distortion.model, Distortion::Model::none);
    EXPECT_TRUE(is_resolved(set.views[i]));
  }
}

TEST_F(TransformsJson, FrameFieldsWinOverTheFilesOwn) {
  json root = sample(3);
  root["frames"][1]["fl_x"] = 500;
  root["frames"][1]["w"] = 320;
  root["frames"][1]["cx"] = 100;
  root["frames"][2]["camera_angle_x"] = 1.0;  // specific to this frame, so it overrides the file's fl_x
  const ViewSet set = read(root);
  EXPECT_EQ(set.views[0].camera.fx, 800);
  EXPECT_EQ(set.views[1].camera.fx, 500);
  EXPECT_EQ(set.views[1].camera.fy, 790);
  EXPECT_EQ(set.views[1].camera.width, 320);
  EXPECT_EQ(set.views[1].camera.cx, 100);
  EXPECT_NEAR(set.views[2].camera.fx, 320 / std::tan(0.5), 1e-9);
}

TEST_F(TransformsJson, FocalLengthsWinOverAnglesAndEqualEachOther) {
  json root = sample(1);
  root["camera_angle_x"] = 0.5;
  root["camera_angle_y"] = 0.4;
  EXPECT_EQ(read(root).views[0].camera.fx, 800);
  root.erase("fl_x");
  EXPECT_EQ(read(root).views[0].camera.fx, 790);
  EXPECT_EQ(read(root).views[0].camera.fy, 790);
  root.erase("fl_y");
  EXPECT_NEAR(read(root).views[0].camera.fx, 320 / std::tan(0.25), 1e-9);
  EXPECT_NEAR(read(root).views[0].camera.fy, 240 / std::tan(0.2), 1e-9);
  root.erase("camera_angle_y");
  EXPECT_NEAR(read(root).views[0].camera.fy, 320 / std::tan(0.25), 1e-9);
  root.erase("camera_angle_x");
  expect_error(Status::format, {"frame 0", "images/0.png", "fl_x", "camera_angle_x"}, [&] { read(root); });
}

TEST_F(TransformsJson, WhatTheSizeGivesStaysOpenUntilItIsKnown) {
  json root = sample(1);
  for (const char* name : {"fl_x", "fl_y", "cx", "cy", "w", "h"}) root.erase(name);
  root["camera_angle_x"] = 0.6911112070083618;
  ViewSet set = read(root);
  ListedView& view = set.views[0];
  EXPECT_FALSE(is_resolved(view));
  EXPECT_EQ(view.camera.width, 0);
  EXPECT_TRUE(std::isnan(view.camera.fx) && std::isnan(view.camera.cx));
  resolve_intrinsics(view, 800, 600);
  EXPECT_TRUE(is_resolved(view));
  EXPECT_NEAR(view.camera.fx, 1111.1110311937682, 1e-9);
  EXPECT_EQ(view.camera.fy, view.camera.fx);
  EXPECT_EQ(view.camera.cx, 400);
  EXPECT_EQ(view.camera.cy, 300);
  expect_error(Status::input, {"800 x 600", "600 x 800", "turning"}, [&] { resolve_intrinsics(view, 600, 800); });
  expect_error(Status::input, {"800 x 600", "400 x 301", "shape"}, [&] { resolve_intrinsics(view, 400, 301); });
}

TEST_F(TransformsJson, PicturesThatWereResizedScaleTheirIntrinsics) {
  json root = sample(1);
  root["w"] = 1067, root["h"] = 800, root["fl_x"] = 1000, root["fl_y"] = 1100, root["cx"] = 520, root["cy"] = 410;
  root["k1"] = 0.1;
  const ListedView listed = read(root).views[0];
  // A third of 1067 x 800, rounded down, up, or to nearest.
  for (const auto& [width, height] : {std::pair{355, 266}, {356, 267}, {355, 267}, {2134, 1600}}) {
    ListedView view = listed;
    resolve_intrinsics(view, width, height);
    const double x = width / 1067.0, y = height / 800.0;
    EXPECT_EQ(view.camera.width, width);
    EXPECT_EQ(view.camera.height, height);
    EXPECT_NEAR(view.camera.fx, 1000 * x, 1e-9);
    EXPECT_NEAR(view.camera.fy, 1100 * y, 1e-9);
    EXPECT_NEAR(view.camera.cx, 520 * x, 1e-9);
    EXPECT_NEAR(view.camera.cy, 410 * y, 1e-9);
    EXPECT_EQ(view.camera.distortion.k[0], 0.1);
  }
  for (const auto& [width, height] : {std::pair{355, 270}, {1067, 790}, {400, 400}}) {
    ListedView view = listed;
    expect_error(Status::input, {"1067 x 800", fmt::format("{} x {}", width, height), "shape"},
                 [&, width = width, height = height] { resolve_intrinsics(view, width, height); });
  }
}

TEST_F(TransformsJson, BackslashesOfWindowsAreTakenForSlashes) {
  json root = sample(1);
  root["frames"][0]["file_path"] = "images\\0.png";
  root["frames"][0]["mask_path"] = "masks\\0.png";
  folder.touch("images/0.png");
  folder.touch("masks/0.png");
  const ListedView view = read(root).views[0];
  EXPECT_EQ(view.name, "images/0.png");
  EXPECT_EQ(view.camera.file, "images/0.png");
  EXPECT_EQ(view.picture, folder / "images/0.png");
  EXPECT_EQ(view.mask, folder / "masks/0.png");
  folder.touch("images\\0.png");  // a file with that name exists
  EXPECT_EQ(read(root).views[0].picture, folder / "images\\0.png");
}

TEST_F(TransformsJson, DistortionOfBothLenses) {
  json root = sample(1);
  root["k1"] = 0.1, root["k2"] = 0.02, root["k3"] = 0.003, root["p1"] = 0.04, root["p2"] = 0.05;
  Distortion lens = read(root).views[0].camera.distortion;  // without camera_model, as instant-ngp writes it
  EXPECT_EQ(lens.model, Distortion::Model::opencv);
  const double opencv[] = {0.1, 0.02, 0.04, 0.05, 0.003, 0, 0, 0};
  for (int i = 0; i < 8; ++i) EXPECT_EQ(lens.k[i], opencv[i]);
  root["p1"] = 0, root["p2"] = 0, root["k4"] = 0.0004;
  expect_error(Status::input, {"k4", "not supported"}, [&] { read(root); });
  root["k4"] = 0, root["camera_model"] = "opencv";
  EXPECT_EQ(read(root).views[0].camera.distortion.model, lens.model) << "in any case";
  root["k4"] = 0.0004;
  root["camera_model"] = "OPENCV_FISHEYE";
  lens = read(root).views[0].camera.distortion;
  EXPECT_EQ(lens.model, Distortion::Model::fisheye);
  const double fisheye[] = {0.1, 0.02, 0.003, 0.0004};
  for (int i = 0; i < 4; ++i) EXPECT_EQ(lens.k[i], fisheye[i]);
  root["camera_model"] = "EQUIRECTANGULAR";
  expect_error(Status::input, {"EQUIRECTANGULAR", "not supported"}, [&] { read(root); });
  root = sample(1);
  root["distortion_params"] = {0.1, 0.02, 0.003, 0, 0.04, 0.05};  // as nerfstudio's cameras hold them
  lens = read(root).views[0].camera.distortion;
  for (int i = 0; i < 8; ++i) EXPECT_EQ(lens.k[i], opencv[i]);
  root["distortion_params"] = {0.1, 0.02};
  expect_error(Status::format, {"frame 0", "distortion_params"}, [&] { read(root); });
}

TEST_F(TransformsJson, LensesThatAreNoneAreNamed) {
  json root = sample(3);
  for (const char* name : {"k1", "k2", "k3", "p1", "p2"})
    for (const double value : {1e300, -1e7}) {
      json bad = root;
      bad["frames"][2][name] = value;
      expect_error(Status::input,
                   {"transforms.json: frame 2", fmt::format("coefficient {} is {}", name, value), "1000000"},
                   [&] { read(bad); });
    }
  root["camera_model"] = "OPENCV_FISHEYE";
  root["k4"] = 1e300;
  expect_error(Status::input, {"frame 0", "coefficient k4 is 1e+300"}, [&] { read(root); });
}

// Code that walks parsed values recurses, so the depth is limited before.
TEST_F(TransformsJson, DeepNestingIsRefused) {
  const std::string open(1000000, '['), close(1000000, ']');
  const std::string text = R"({"frames": [{"file_path": "a", "fl_x": 1, "transform_matrix": )";
  const auto path = folder.write("transforms.json", text + open + close + "}]}");
  expect_error(Status::format, {"transforms.json: byte 91", "deeper than 32"}, [&] { read_views(path); });
  // Brackets in a text do not count.
  folder.write("transforms.json", text + '"' + open + "\"}]}");
  expect_error(Status::format, {"frame 0", "transform_matrix is \"[[["}, [&] { read_views(path); });
}

TEST_F(TransformsJson, HugeFilesAreRefusedUnread) {
  const auto path = folder.write("transforms.json", "{");
  std::filesystem::resize_file(path, std::uintmax_t{1} << 40);  // a sparse file that takes no disk space
  expect_error(Status::format, {"transforms.json", "64 MiB"}, [&] { read_views(path); });
}

TEST_F(TransformsJson, CubeAndMasks) {
  json root = sample(2);
  root["aabb_center"] = {0.5, -1, 2};
  root["aabb_half"] = 0.75;
  root["frames"][1]["mask_path"] = "masks/1.png";
  const ViewSet set = read(root);
  EXPECT_EQ(*set.aabb_center, Eigen::Vector3d(0.5, -1, 2));
  EXPECT_EQ(*set.aabb_half, 0.75);
  EXPECT_FALSE(set.views[0].mask);
  EXPECT_EQ(*set.views[1].mask, folder / "masks/1.png");
  for (const double half : {0.0, -1.0, 1e-30, 1e300}) {
    root["aabb_half"] = half;
    expect_error(Status::input, {"transforms.json: aabb_half"}, [&] { read(root); });
  }
  root["aabb_half"] = 0.75;
  root["aabb_center"] = {0, 1e300, 0};
  expect_error(Status::input, {"transforms.json: aabb_center"}, [&] { read(root); });
  root["aabb_center"] = nullptr;
  for (const nlohmann::json& points :
       {nlohmann::json(3), nlohmann::json(std::string("a\0b", 3)), nlohmann::json::array()}) {
    root["ply_file_path"] = points;
    expect_error(Status::format, {"transforms.json: ply_file_path"}, [&] { read(root); });
  }
}

TEST_F(TransformsJson, FramesWithoutPictureAreCountedOnce) {
  folder.touch("images/1.png");
  folder.touch("images/3.png");
  json root = sample(4);
  root["frames"][3]["file_path"] = "./images/3";  // NeRF-synthetic omits the ending
  test::Warnings warnings;
  const ViewSet set = read(root, true);
  ASSERT_EQ(warnings.all.size(), 1U);
  EXPECT_NE(warnings.all[0].find("2 of 4"), std::string::npos) << warnings.all[0];
  EXPECT_TRUE(set.views[0].picture.empty());
  EXPECT_EQ(set.views[1].picture, folder / "images/1.png");
  EXPECT_TRUE(std::filesystem::exists(set.views[3].picture));
  std::filesystem::remove_all(folder / "images");
  expect_error(Status::input, {"none of the 4", "images/0.png"}, [&] { read(root, true); });
}

TEST_F(TransformsJson, PicturesElsewhere) {
  folder.touch("elsewhere/0.png");
  const auto path = folder.write("transforms.json", sample(1).dump());
  const ViewSet set = read_views(path, {.pictures_dir = folder / "elsewhere"});
  EXPECT_EQ(set.views[0].picture, folder / "elsewhere/0.png");
  expect_error(Status::file, {"nowhere"}, [&] { read_views(path, {.pictures_dir = folder / "nowhere"}); });
}

TEST_F(TransformsJson, UnusablePosesAreNamed) {
  const auto with = [&](auto change) {
    json root = sample(3);
    change(root["frames"][2]["transform_matrix"]);
    return [this, root] { read(root); };
  };
  const std::string where = "frame 2 (images/2.png)";
  expect_error(Status::input, {where, "singular"}, with([](json& m) { m[0] = m[1]; }));
  expect_error(Status::input, {where, "singular"}, with([](json& m) {
                 for (int r = 0; r < 3; ++r) m[r] = {0, 0, 0, 1};
               }));
  expect_error(Status::input, {where, "mirrors"}, with([](json& m) {
                 for (int r = 0; r < 3; ++r) m[r][0] = -m[r][0].get<double>();
               }));
  expect_error(Status::input, {where, "scales by 2.5"}, with([](json& m) {
                 for (int r = 0; r < 3; ++r)
                   for (int c = 0; c < 3; ++c) m[r][c] = 2.5 * m[r][c].get<double>();
               }));
  expect_error(Status::input, {where, "not rigid"}, with([](json& m) { m[0][0] = m[0][0].get<double>() + 0.01; }));
  expect_error(Status::input, {where, "last row"}, with([](json& m) { m[3][3] = 2; }));
  expect_error(Status::input, {where, "last row", "transposed"}, with([](json& m) {
                 const json original = m;
                 for (int r = 0; r < 4; ++r)
                   for (int c = 0; c < 4; ++c) m[r][c] = original[c][r];
               }));
  expect_error(Status::format, {where, "transform_matrix", "4 rows of 4"}, with([](json& m) { m[1].erase(0); }));
  expect_error(Status::format, {where, "transform_matrix[1][2]", "\"a\""}, with([](json& m) { m[1][2] = "a"; }));
}

TEST_F(TransformsJson, RoundedPosesAreMadeOrthonormal) {
  json root = sample(1);
  json& m = root["frames"][0]["transform_matrix"];
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m[r][c] = std::round(1e4 * m[r][c].get<double>()) / 1e4;
  const Eigen::Matrix3d R = read(root).views[0].camera.w2c.topLeftCorner<3, 3>();
  EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-14);
}

TEST_F(TransformsJson, NumbersThatAreNone) {
  std::string text = sample(2).dump();
  const std::string focal = "\"fl_x\":800.0";
  const auto at = text.find(focal);
  ASSERT_NE(at, std::string::npos);
  for (const char* word : {"NaN", "Infinity", "-Infinity"})  // as Python writes them
    expect_error(Status::input, {"fl_x", word}, [&] { read_text(std::string(text).replace(at + 7, 5, word)); });
  expect_error(Status::input, {"focal length", "-800"},
               [&] { read_text(std::string(text).replace(at + 7, 5, "-800")); });
  expect_error(Status::input, {"focal length"}, [&] { read_text(std::string(text).replace(at + 7, 5, "0")); });
  expect_error(Status::format, {"fl_x", "[1]"}, [&] { read_text(std::string(text).replace(at + 7, 5, "[1]")); });
  json root = sample(1);
  root["w"] = 640.5;
  expect_error(Status::input, {"w is 640.5"}, [&] { read(root); });
  root["w"] = 1e9;
  expect_error(Status::input, {"w is 1000000000"}, [&] { read(root); });
}

TEST_F(TransformsJson, MisshapenFiles) {
  expect_error(Status::format, {"not valid JSON", "line 1"}, [&] { read_text("{\"frames\": ["); });
  expect_error(Status::format, {"neither"}, [&] { read_text("{}"); });
  expect_error(Status::format, {"neither"}, [&] { read_text("3"); });
  expect_error(Status::input, {"lists no frames"}, [&] { read_text("{\"frames\": []}"); });
  expect_error(Status::format, {"frames is 3"}, [&] { read_text("{\"frames\": 3}"); });
  expect_error(Status::format, {"frame 0", "an object"}, [&] { read_text("{\"frames\": [3]}"); });
  json root = sample(1);
  root["frames"][0].erase("transform_matrix");
  expect_error(Status::format, {"has no transform_matrix"}, [&] { read(root); });
  root = sample(1);
  root["frames"][0].erase("file_path");
  EXPECT_EQ(read(root).views.size(), 1U);  // a target camera needs no picture
  expect_error(Status::format, {"frame 0", "file_path"}, [&] { read(root, true); });
  expect_error(Status::file, {"no such file"}, [&] { read_views(folder / "absent.json"); });
  std::filesystem::create_directory(folder / "empty");
  expect_error(Status::file, {"no cameras"}, [&] { read_views(folder / "empty"); });
}

TEST_F(TransformsJson, DamagedFilesNeverCrash) {
  json root = sample(3);
  root["camera_angle_x"] = 0.5;
  root["aabb_center"] = {0, 0, 0};
  root["frames"][1]["mask_path"] = "m.png";
  const std::string text = root.dump();
  unsigned random = 12345;
  int good = 0;
  for (int i = 0; i < 400; ++i) {
    random = random * 1664525U + 1013904223U;
    std::string damaged = text;
    const std::size_t at = (random >> 8) % text.size();
    if (i % 2 == 0) {
      damaged.resize(at);
    } else {
      damaged[at] = static_cast<char>(damaged[at] ^ (1 << (random % 7)));
    }
    try {
      read_text(damaged);
      ++good;
    } catch (const Error&) {
    }
  }
  EXPECT_LT(good, 200);  // a flipped digit may still be a camera; no half of a file is
}

}  // namespace
}  // namespace vsplat
