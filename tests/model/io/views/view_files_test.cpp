// Pictures and masks of whole sets, and which list of a folder is read.
#include <nlohmann/json.hpp>

#include "model/io/views/view_set.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using nlohmann::json;
using test::expect_error;

json pose_at(double x) { return {{1, 0, 0, x}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}; }

class ViewFiles : public ::testing::Test {
 protected:
  json list_of(const std::vector<std::string>& names) {
    json root = {{"fl_x", 20}, {"w", 16}, {"h", 16}, {"frames", json::array()}};
    for (const std::string& name : names)
      root["frames"].push_back({{"file_path", name}, {"transform_matrix", pose_at(root["frames"].size())}});
    return root;
  }
  ViewSet read(const json& root, const ReadOptions& options = {}, const std::string& file = "transforms.json") {
    return read_views(folder.write(file, root.dump()), options);
  }
  // A COLMAP model with images of these names.
  void write_model(const std::string& at, const std::vector<std::string>& names, const std::string& cameras = "") {
    folder.write(at + "/cameras.txt", cameras.empty() ? "1 PINHOLE 16 16 20 20 8 8\n" : cameras);
    std::string text;
    for (std::size_t i = 0; i < names.size(); ++i)
      text += fmt::format("{} 1 0 0 0 {} 0 0 1 {}\n\n", i + 1, i, names[i]);
    folder.write(at + "/images.txt", text);
  }
  std::string picture(const ViewSet& set, std::size_t i) {
    return set.views[i].picture.empty() ? "" : std::filesystem::relative(set.views[i].picture, folder.path()).string();
  }
  std::string mask(const ViewSet& set, std::size_t i) {
    return set.views[i].mask ? std::filesystem::relative(*set.views[i].mask, folder.path()).string() : "";
  }
  test::ViewFolder folder;
};

TEST_F(ViewFiles, AListsPicturesAreFoundBesideItOrInImages) {
  folder.touch("images/1.JPG");
  folder.touch("2.png");
  const ViewSet set = read(list_of({"/data/set/images/1.jpg", "2"}));
  EXPECT_EQ(picture(set, 0), "images/1.JPG");
  EXPECT_EQ(picture(set, 1), "2.png");
  folder.touch("images/3.webp");
  EXPECT_EQ(picture(read(list_of({"frames/3.png"})), 0), "images/3.webp");
}

TEST_F(ViewFiles, TheGivenFolderComesBeforeWhatIsListed) {
  folder.touch("images/1.png");
  folder.touch("small/1.jpg");
  EXPECT_EQ(picture(read(list_of({"images/1.png"})), 0), "images/1.png");
  EXPECT_EQ(picture(read(list_of({"images/1.png"}), {.pictures_dir = folder / "small"}), 0), "small/1.jpg");
  expect_error(Status::input, {"none of the 1", "images/2.png", "looked for", "small"},
               [&] { read(list_of({"images/2.png"}), {.pictures_dir = folder / "small"}); });
}

// Otherwise one picture would be used for two cameras.
TEST_F(ViewFiles, TwoViewsDoNotShareAPictureByTheirTails) {
  folder.touch("images/1.png");
  expect_error(Status::input, {"left/1.png", "right/1.png", "images/1.png"}, [&] {
    read(list_of({"left/1.png", "right/1.png"}));
  });
  EXPECT_EQ(read(list_of({"images/1.png", "images/1.png"})).views.size(), 2U) << "one that is listed twice is";
}

TEST_F(ViewFiles, MasksAreFoundAsPicturesAre) {
  for (const char* name : {"images/1.png", "images/2.png", "masks/1.PNG", "masks/2.png"}) folder.touch(name);
  json root = list_of({"images/1.png", "images/2.png"});
  root["frames"][0]["mask_path"] = "C:\\set\\masks\\1.png";
  const ViewSet set = read(root);
  EXPECT_EQ(mask(set, 0), "masks/1.PNG");
  EXPECT_EQ(mask(set, 1), "") << "the list names the masks, and none for this one";
}

// Written on a system that composes accents and copied to one that does not, or the reverse.
TEST_F(ViewFiles, PicturesAndMasksAreFoundInEitherUnicodeForm) {
  const std::string composed = "k\u00e4se", decomposed = "ka\u0308se";
  for (const auto& [listed, there] : {std::pair(composed, decomposed), std::pair(decomposed, composed)}) {
    const std::string set_folder = "of " + listed, picture_file = set_folder + "/images/" + there + ".jpg",
                      mask_file = set_folder + "/masks/" + there + ".png";
    folder.touch(picture_file);
    folder.touch(mask_file);
    const ViewSet list = read(list_of({"images/" + listed + ".jpg"}), {}, set_folder + "/transforms.json");
    EXPECT_EQ(picture(list, 0), picture_file);
    EXPECT_EQ(mask(list, 0), mask_file);
    write_model(set_folder + "/sparse/0", {listed + ".jpg"});
    const ViewSet model = read_views(folder / (set_folder + "/sparse/0"), {});
    EXPECT_EQ(picture(model, 0), picture_file);
    EXPECT_EQ(mask(model, 0), mask_file);
    json root = list_of({"images/" + listed + ".jpg"});
    root["frames"][0]["mask_path"] = "masks/" + listed + ".png";
    root["ply_file_path"] = listed + ".ply";
    folder.touch(set_folder + "/" + there + ".ply");
    const ViewSet named = read(root, {}, set_folder + "/named.json");
    EXPECT_EQ(mask(named, 0), mask_file);
    EXPECT_EQ(named.points, folder / (set_folder + "/" + there + ".ply"));
  }
  folder.touch("images/" + composed + ".png");
  expect_error(Status::input, {"would share the picture"}, [&] {
    read(list_of({"images/" + composed + ".png", "images/" + decomposed + ".png"}));
  });
}

TEST_F(ViewFiles, AFolderOfMasksMayBeCalledMask) {
  for (const char* name : {"images/1.jpg", "Mask/1.png"}) folder.touch(name);
  EXPECT_EQ(mask(read(list_of({"images/1.jpg"})), 0), "Mask/1.png");
}

TEST_F(ViewFiles, AListInAnotherEncodingIsToldSo) {
  const std::string path = folder.write("transforms.json", std::string("\xff\xfe{\0}\0", 6));
  expect_error(Status::format, {"transforms.json", "UTF-16", "iconv"}, [&] { read_views(path, {}); });
}

TEST_F(ViewFiles, AFolderOfMasksIsTakenWhereTheListNamesNone) {
  for (const char* name : {"images/a/1.jpg", "images/2.jpg", "masks/a/1.png", "masks/2.jpg.png"}) folder.touch(name);
  const ViewSet set = read(list_of({"images/a/1.jpg", "images/2.jpg"}));
  EXPECT_EQ(mask(set, 0), "masks/a/1.png");
  EXPECT_EQ(mask(set, 1), "masks/2.jpg.png");
  std::filesystem::remove(folder / "masks/2.jpg.png");
  EXPECT_NE(read(list_of({"images/a/1.jpg", "images/2.jpg"})).masks_found.find("1 of 2"), std::string::npos);
  // A view with a missing mask is omitted on request.
  test::Warnings warnings;
  const ViewSet good = read(list_of({"images/a/1.jpg", "images/2.jpg"}), {.bad = BadViews::leave_out});
  EXPECT_TRUE(good.views[0].problem.empty());
  EXPECT_NE(good.views[1].problem.find("masks/images/2.png"), std::string::npos) << good.views[1].problem;
  ASSERT_EQ(warnings.all.size(), 1U);
  EXPECT_NE(warnings.all[0].find("1 of 2"), std::string::npos) << warnings.all[0];
  std::filesystem::remove_all(folder / "masks/a");
  folder.touch("masks/other.png");
  const ViewSet unmasked = read(list_of({"images/a/1.jpg"}));
  EXPECT_EQ(mask(unmasked, 0), "");
  ASSERT_EQ(warnings.all.size(), 2U);
  EXPECT_NE(warnings.all[1].find("is not used"), std::string::npos) << warnings.all[1];
}

TEST_F(ViewFiles, PartsOfNerfSyntheticAreSets) {
  for (const char* name : {"train/r_0.png", "train/r_1.png", "val/r_0.png", "test/r_0.png"}) folder.touch(name);
  const auto part = [&](const char* file, const std::vector<std::string>& names) {
    json root = list_of(names);
    for (const char* field : {"fl_x", "w", "h"}) root.erase(field);
    root["camera_angle_x"] = 0.8;
    folder.write(file, root.dump());
  };
  part("transforms_train.json", {"./train/r_0", "./train/r_1"});
  part("transforms_val.json", {"./val/r_0"});
  part("transforms_test.json", {"./test/r_0"});
  EXPECT_TRUE(holds_views(folder.path()));
  const ViewSet set = read_views(folder.path());
  ASSERT_EQ(set.views.size(), 2U);
  EXPECT_EQ(picture(set, 1), "train/r_1.png");
  ASSERT_EQ(set.choices.size(), 1U);
  EXPECT_NE(set.choices[0].find("transforms_val.json, transforms_test.json"), std::string::npos) << set.choices[0];
  const ViewSet all = read_views(folder.path(), {.all_splits = true});
  ASSERT_EQ(all.views.size(), 4U);
  EXPECT_EQ(all.views[1].split, Split::train);
  EXPECT_EQ(all.views[2].split, Split::val);
  EXPECT_EQ(all.views[3].split, Split::test);
  EXPECT_EQ(picture(all, 3), "test/r_0.png");
  EXPECT_EQ(read_views(folder / "transforms_test.json").views.size(), 1U);
  // If the whole set exists, it is read instead.
  folder.touch("1.png");
  EXPECT_EQ(read(list_of({"1.png"})).views.size(), 1U);
  EXPECT_EQ(read_views(folder.path()).views.size(), 1U);
}

TEST_F(ViewFiles, PartsThatATransformsFileLists) {
  json root = list_of({"images/1.png", "images/2.png"});
  root["train_filenames"] = {"./images/1.png"};
  root["test_filenames"] = {"images/2.png"};
  const ViewSet set = read(root, {.need_pictures = false});
  EXPECT_EQ(set.views[0].split, Split::train);
  EXPECT_EQ(set.views[1].split, Split::test);
}

TEST_F(ViewFiles, OfSeveralModelsTheOneWithTheMostPictures) {
  for (const char* name : {"1.png", "2.png", "3.png"}) folder.touch(std::string("images/") + name);
  write_model("sparse/0", {"1.png", "2.png"});
  write_model("sparse/1", {"1.png", "2.png", "3.png"});
  write_model("sparse/2", {"3.png"});
  for (const auto& path : {folder.path(), folder / "sparse"}) {
    const ViewSet set = read_views(path);
    EXPECT_EQ(set.views.size(), 3U);
    ASSERT_EQ(set.choices.size(), 1U);
    EXPECT_NE(set.choices[0].find("sparse/1"), std::string::npos) << set.choices[0];
  }
  EXPECT_EQ(read_views(folder / "sparse/0").views.size(), 2U) << "one that is named is read";
}

TEST_F(ViewFiles, ModelsWhereProgramsPutThem) {
  for (const auto& [model, pictures] : {std::pair{"colmap/sparse/0", "images"},
                                        {"dense/sparse", "dense/images"},
                                        {"dense/0/sparse", "dense/0/images"},
                                        {"dense/0/sparse/0", "dense/0/images"},
                                        {"distorted/sparse/0", "input"},
                                        {"sparse/0", "."},
                                        {".", "."}}) {
    const test::ViewFolder other;
    folder.write("x", "");
    write_model(model, {"1.png"});
    folder.touch(std::string(pictures) + "/1.png");
    const ViewSet set = read_views(folder.path());
    EXPECT_TRUE(std::filesystem::equivalent(set.views[0].picture, folder / (std::string(pictures) + "/1.png")))
        << model;
    for (const auto& entry : std::filesystem::directory_iterator(folder.path()))
      std::filesystem::remove_all(entry.path());
  }
  // Numbered objects of a data set are not components of one model.
  write_model("0", {"1.png"});
  write_model("1", {"1.png"});
  EXPECT_FALSE(holds_views(folder.path()));
  expect_error(Status::file, {"no cameras", "/0, ", "/1: give one"}, [&] { read_views(folder.path()); });
}

// images/ beside a model in distorted/ holds the undistorted pictures.
TEST_F(ViewFiles, AModelsPicturesAreWhereMostOfThemAre) {
  for (const char* name : {"input/1.png", "input/2.png", "images/1.png", "images/2.png"}) folder.touch(name);
  write_model("distorted/sparse/0", {"1.png", "2.png"});
  EXPECT_EQ(picture(read_views(folder / "distorted"), 0), "input/1.png");
  write_model("sparse/0", {"1.png", "2.png"});
  EXPECT_EQ(picture(read_views(folder.path()), 0), "images/1.png");
  std::filesystem::remove(folder / "images/1.png");
  EXPECT_EQ(picture(read_views(folder.path()), 0), "input/1.png");
  write_model("sparse/0", {"images/1.jpg", "images/2.jpg"});
  EXPECT_EQ(picture(read_views(folder.path(), {.pictures_dir = folder / "input"}), 1), "input/2.png");
}

TEST_F(ViewFiles, WhatNoImageUsesIsNotChecked) {
  folder.touch("images/1.png");
  folder.touch("images/2.png");
  const std::string good = "1 PINHOLE 16 16 20 20 8 8\n";
  for (const char* bad : {"2 THIN_PRISM_FISHEYE 16 16 1 1 1 1 0 0 0 0 0 0 0 0\n",
                          "2 OPENCV 16 16 nan nan 8 8 0 0 0 0\n", "2 OPENCV 16 16 20 20 8 8 0 0\n", "2 NONE\n"}) {
    write_model("sparse/0", {"1.png", "2.png"}, good + bad);
    EXPECT_EQ(read_views(folder.path()).views.size(), 2U) << bad;
    folder.write("sparse/0/images.txt", "1 1 0 0 0 0 0 0 1 1.png\n\n2 1 0 0 0 1 0 0 2 2.png\n\n");
    EXPECT_THROW(read_views(folder.path()), Error) << bad;
    test::Warnings warnings;
    const ViewSet set = read_views(folder.path(), {.bad = BadViews::leave_out});
    EXPECT_TRUE(set.views[0].problem.empty());
    EXPECT_NE(set.views[1].problem.find("camera 2"), std::string::npos) << set.views[1].problem;
    EXPECT_TRUE(set.views[1].picture.empty());
    ASSERT_EQ(warnings.all.size(), 1U) << bad;
    EXPECT_NE(warnings.all[0].find("1 of 2 views"), std::string::npos) << warnings.all[0];
  }
}

TEST_F(ViewFiles, FramesThatCannotBeUsed) {
  for (const char* name : {"1.png", "2.png", "3.png"}) folder.touch(name);
  for (const json& bad : {json(nullptr), json("NaN"), json::array(), pose_at(0).front(),
                          json{{0, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}, {0, 0, 0, 0}}}) {
    json root = list_of({"1.png", "2.png", "3.png"});
    root["frames"][1]["transform_matrix"] = bad;
    try {
      read(root);
      ADD_FAILURE() << bad.dump();
    } catch (const Error& e) {
      const std::string text = e.what();
      EXPECT_NE(text.find("frame 1 (2.png)"), std::string::npos) << text;
      EXPECT_NE(text.find("1 of 3 views cannot be used"), std::string::npos) << text;
      EXPECT_NE(text.find("skip_bad"), std::string::npos) << text;
    }
    test::Warnings warnings;
    const ViewSet set = read(root, {.bad = BadViews::leave_out});
    ASSERT_EQ(set.views.size(), 3U) << "indices stay those of the list";
    EXPECT_FALSE(set.views[1].problem.empty());
    EXPECT_EQ(warnings.all.size(), 1U);
    EXPECT_TRUE(read(root, {.bad = BadViews::keep}).views[2].problem.empty());
  }
  json root = list_of({"1.png"});
  root["frames"][0].erase("transform_matrix");
  expect_error(Status::format, {"has no transform_matrix"}, [&] { read(root, {.bad = BadViews::leave_out}); });
}

TEST_F(ViewFiles, WhatIsNoListIsNamed) {
  const auto refused = [&](const std::string& file, const std::string& bytes, const std::vector<std::string>& words) {
    expect_error(Status::format, words, [&] { read_views(folder.write(file, bytes)); });
  };
  refused("a.jpg", "\xff\xd8\xff\xe0", {"a.jpg", "a JPEG picture", "vsplat poses", "masks"});
  refused("b", "\x89PNG\r\n", {"b", "a PNG picture"});
  refused("c.mp4", std::string("\0\0\0\x18", 4) + "ftypisom", {"a video", "c.mp4 --output c-posed"});
  refused("my walk.avi", std::string("RIFF\1\2\3\4") + "AVI LIST",
          {"a video", "my walk.avi' --output 'my walk-posed'"});
  refused("c.json", "{\"fl_x\":AVI }", {"c.json", "JSON"});
  refused("d.ply", "ply\nformat", {"a PLY file"});
  refused("e.db", "SQLite format 3", {"a database"});
  refused("e.json", "", {"an empty file"});
  refused("f.json", "{\"views\": [], \"extrinsics\": []}", {"neither", "views", "extrinsics"});
  write_model("sparse/0", {"1.png"});
  refused("a.jpg", "\xff\xd8\xff\xe0", {"a JPEG picture", "give its folder"});
}

TEST_F(ViewFiles, AFolderWithoutCamerasSaysHowToGetThem) {
  folder.touch("photos/1.jpg");
  folder.touch("photos/2.jpg");
  expect_error(Status::file,
               {"no cameras", "2 pictures", "vsplat poses " + folder.string() + "/photos --output photos-posed",
                "masks", "--mask-command"},
               [&] { read_views(folder / "photos"); });
  write_model("photos/deeper/sparse/0", {"1.png"});
  expect_error(Status::file, {"no cameras", "photos/deeper: give that folder"}, [&] { read_views(folder / "photos"); });
}

TEST_F(ViewFiles, CameraPathsOfNerfstudioAreTargets) {
  const json pose = pose_at(2);
  json flat = json::array();
  for (const json& row : pose)
    for (const json& value : row) flat.push_back(value);
  const json root = {
      {"camera_type", "perspective"},
      {"render_width", 64},
      {"render_height", 32},
      {"camera_path", {{{"camera_to_world", flat}, {"fov", 90}}, {{"camera_to_world", pose}, {"fov", 45}}}}};
  test::Warnings warnings;
  const ViewSet set = read(root, {.need_pictures = false}, "camera_path.json");
  ASSERT_EQ(set.views.size(), 2U);
  const Camera& c = set.views[0].camera;
  EXPECT_EQ(c.width, 64);
  EXPECT_NEAR(c.fx, 16, 1e-12);
  EXPECT_NEAR(c.fy, 16, 1e-12);
  EXPECT_NEAR(c.centre().x(), 2, 1e-12);
  EXPECT_LT((c.c2w().col(2) - Eigen::Vector4d(0, 0, -1, 0)).norm(), 1e-12) << "OpenGL's axes";
  EXPECT_LT((set.views[1].camera.w2c - c.w2c).norm(), 1e-12);
  EXPECT_EQ(warnings.all.size(), 1U);
  expect_error(Status::input, {"path of cameras"}, [&] { read(root, {}, "camera_path.json"); });
}

}  // namespace
}  // namespace vsplat
