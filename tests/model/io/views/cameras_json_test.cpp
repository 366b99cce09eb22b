#include "model/io/views/cameras_json.h"

#include <Eigen/LU>
#include <nlohmann/json.hpp>

#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using nlohmann::json;
using test::expect_error;

TEST(CamerasJson, WrittenAndReadBackToTheLastBit) {
  const test::ViewFolder folder;
  std::vector<Camera> cameras = test::ring(5, {0.1, 1e-7, -12345.678}, 1.0 / 3);
  cameras[1].file = "a \"quoted\" \\ name.png";
  cameras[2].cy = -17.123456789012345;
  write_cameras(folder / "cameras.json", cameras);
  const ViewSet set = read_views(folder.path(), {.need_pictures = false});
  ASSERT_EQ(set.views.size(), cameras.size());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera &got = set.views[i].camera, &want = cameras[i];
    EXPECT_EQ(got.file, want.file);
    EXPECT_EQ(got.width, want.width);
    EXPECT_EQ(got.height, want.height);
    EXPECT_TRUE(got.fx == want.fx && got.fy == want.fy && got.cx == want.cx && got.cy == want.cy);
    EXPECT_EQ(got.w2c, want.w2c);
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);  // no temporary file stays
}

TEST(CamerasJson, WhatTheFormatCannotHoldIsNotWritten) {
  const test::ViewFolder folder;
  std::vector<Camera> cameras = test::ring(2);
  cameras[1].distortion.model = Distortion::Model::opencv;
  expect_error(Status::internal, {"distortion"}, [&] { write_cameras(folder / "cameras.json", cameras); });
  cameras = test::ring(2);
  cameras[0].cx = std::nan("");
  expect_error(Status::internal, {"not finite"}, [&] { write_cameras(folder / "cameras.json", cameras); });
  expect_error(Status::file, {"absent"}, [&] { write_cameras(folder / "absent/cameras.json", test::ring(1)); });
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

json inria_of(const Camera& c) {
  const Eigen::Matrix4d m = c.w2c.inverse();
  json rotation = json::array();
  for (int r = 0; r < 3; ++r) rotation.push_back({m(r, 0), m(r, 1), m(r, 2)});
  return {{"id", 0},
          {"img_name", "view"},
          {"width", c.width},
          {"height", c.height},
          {"position", {m(0, 3), m(1, 3), m(2, 3)}},
          {"rotation", rotation},
          {"fx", c.fx},
          {"fy", c.fy}};
}

TEST(CamerasJson, InriaIsToldApartByItsKeys) {
  const test::ViewFolder folder;
  const std::vector<Camera> cameras = test::ring(3, {1, 2, 3});
  json root = json::array();
  for (const Camera& c : cameras) root.push_back(inria_of(c));
  folder.write("cameras.json", root.dump());
  folder.touch("images/view.jpg");
  const ViewSet set = read_views(folder.path());
  EXPECT_EQ(set.convention, PoseConvention::opencv_position);
  EXPECT_EQ(set.views[2].picture, folder / "images/view.jpg");
  for (int i = 0; i < 3; ++i) {
    EXPECT_LT((set.views[i].camera.w2c - cameras[i].w2c).cwiseAbs().maxCoeff(), 1e-14);
    EXPECT_EQ(set.views[i].camera.cx, 320);
    EXPECT_EQ(set.views[i].camera.cy, 240);
    EXPECT_EQ(set.views[i].camera.fy, 790);
  }
}

TEST(CamerasJson, ErrorsNameCameraAndField) {
  const test::ViewFolder folder;
  write_cameras(folder / "cameras.json", test::ring(3));
  std::ifstream in(folder / "cameras.json");
  const json good = json::parse(in);
  const auto with = [&](auto change) {
    json root = good;
    change(root[1]);
    return [&folder, root] { read_views(folder.write("changed.json", root.dump()), {.need_pictures = false}); };
  };
  const std::string where = "camera 1";
  for (const char* field : {"w", "h", "fx", "fy", "cx", "cy"})
    expect_error(Status::format, {where, std::string("has no ") + field}, with([&](json& c) { c.erase(field); }));
  expect_error(Status::format, {where, "neither w2c"}, with([](json& c) { c.erase("w2c"); }));
  expect_error(Status::format, {where, "w2c"}, with([](json& c) { c["w2c"] = 3; }));
  expect_error(Status::format, {where, "cx", "null"}, with([](json& c) { c["cx"] = nullptr; }));
  expect_error(Status::format, {where, "file"}, with([](json& c) { c["file"] = 3; }));
  expect_error(Status::input, {where, "focal length fy"}, with([](json& c) { c["fy"] = 0; }));
  expect_error(Status::input, {where, "w2c[0][3]"}, with([](json& c) { c["w2c"][0][3] = "NaN"; }));
  expect_error(Status::input, {where, "singular"}, with([](json& c) { c["w2c"][2] = c["w2c"][1]; }));
  expect_error(Status::format, {where, "an object"}, with([](json& c) { c = json::array(); }));
  expect_error(Status::input, {"lists no cameras"}, [&] { read_views(folder.write("empty.json", "[]")); });
}

}  // namespace
}  // namespace vsplat
