// Data sets in all their layouts: which objects are found, that each layout gives the same views, and the errors of
// damaged files.
#include "model/data/data_set.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>

#include "model/data/framed_object.h"
#include "model/data/survey.h"
#include "model/io/archive/hdf5_file.h"
#include "model/io/picture/image_file.h"
#include "tests/support/data_sets.h"
#include "tests/support/hdf5_writer.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using test::expect_error;
using test::Hdf5Writer;
using test::TemporaryFolder;
using Names = std::vector<std::string>;

constexpr int size = 12, views = 5;

Names names_of(const DataSet& set) {
  Names out;
  for (const DataObject& object : set.objects) out.push_back(object.name);
  return out;
}

// A solid in a plain folder, and its views.
struct Solid {
  explicit Solid(const TemporaryFolder& folder) {
    test::write_solids(folder, 1, views, size);
    photographs = open_object(open_data_set({folder / "solid_0"}).objects.at(0));
    for (const ListedView& view : photographs.set.views) pictures.push_back(read_image(view.picture.string()));
  }
  const Camera& camera(int i) const { return photographs.set.views[i].camera; }
  void write(Hdf5Writer& file, const std::string& group, bool single = true) const {
    for (int i = 0; i < views; ++i) file.view(group, i, pictures[i], camera(i), single);
  }
  Photographs photographs;
  std::vector<Image> pictures;
};

// The same pictures from the same cameras.
void expect_same(const Photographs& a, const Photographs& b, double tolerance) {
  ASSERT_EQ(a.set.views.size(), b.set.views.size());
  for (std::size_t i = 0; i < a.set.views.size(); ++i) {
    const Camera &p = a.set.views[i].camera, &q = b.set.views[i].camera;
    EXPECT_LE((p.w2c - q.w2c).norm(), tolerance) << i;
    EXPECT_NEAR(p.fx, q.fx, tolerance * p.fx);
    EXPECT_NEAR(p.cy, q.cy, tolerance * p.cy);
    const Framing framing{7, Crop::automatic};
    const FramedView u = LoadedPhotograph(a, static_cast<int>(i)).framed(framing),
                     v = LoadedPhotograph(b, static_cast<int>(i)).framed(framing);
    EXPECT_EQ(u.image.data, v.image.data) << i;
    EXPECT_NEAR(u.camera.fx, v.camera.fx, tolerance * p.fx);
  }
}

TEST(DataSetLayouts, ReadLaRasHdf5) {
  const TemporaryFolder folder;
  const Solid solid(folder);
  {
    Hdf5Writer file(folder / "set.h5");
    solid.write(file, "b_cup");
    solid.write(file, "a_bowl", false);  // CO3D: double
    file.numbers("b_cup/bbox", {2, 3}, {-1, -1, -1, 1, 1, 1});
    file.numbers("b_cup/groups/groups_4_0", {2}, {0, 3});
    file.numbers("splits/test", {1}, {0});
  }
  const DataSet set = open_data_set({folder / "set.h5"});
  EXPECT_EQ(names_of(set), (Names{"a_bowl", "b_cup"}));
  EXPECT_STREQ(name_of(set.objects[0].layout), "hdf5");
  expect_same(solid.photographs, open_object(set.objects[0]), 1e-12);
  expect_same(solid.photographs, open_object(set.objects[1]), 1e-6);
  EXPECT_EQ(open_object(set.objects[1]).set.views[2].name, "image_2");
}

TEST(DataSetLayouts, CountLinkedObjectsOfPartsOnce) {
  const TemporaryFolder folder;
  const Solid solid(folder);
  fs::create_directories(folder / "parts");
  {
    Hdf5Writer one(folder / "parts/part_1.h5"), two(folder / "parts/part_2.h5"), all(folder / "parts/all.h5");
    solid.write(one, "cup");
    solid.write(two, "bowl");
    all.external("cup", "part_1.h5", "/cup");
    all.external("bowl", "part_2.h5", "/bowl");
  }
  EXPECT_EQ(names_of(open_data_set({folder / "parts"})), (Names{"bowl", "cup"}));
  const DataSet linked = open_data_set({folder / "parts/all.h5"});
  EXPECT_EQ(names_of(linked), (Names{"bowl", "cup"}));
  expect_same(solid.photographs, open_object(linked.objects[1]), 1e-6);
  fs::remove(folder / "parts/part_1.h5");
  expect_error(Status::format, {"object cup", "all.h5"}, [&] { open_object(linked.objects[1]); });
  EXPECT_EQ(names_of(open_data_set({folder.string()})), (Names{"solid_0", "bowl", "cup"})) << "layouts side by side";
}

TEST(DataSetLayouts, ReadLaRasScannedObjects) {
  const TemporaryFolder folder;
  const Solid solid(folder);
  fs::create_directories(folder / "gso/cup");
  nlohmann::json root = test::read_transforms(folder / "solid_0");
  const Camera& c = solid.camera(0);
  nlohmann::json frames;
  for (int i = 0; i < views; ++i) {
    const double to512 = 512.0 / size;
    nlohmann::json k = {{c.fx * to512, 0, c.cx * to512}, {0, c.fy * to512, c.cy * to512}, {0, 0, 1}};
    frames.push_back({{"file_path", "somewhere/else"},
                      {"transform_matrix", root["frames"][i]["transform_matrix"]},
                      {"intrinsic_matrix", k}});
    Image large(512, 512, 4);
    for (int y = 0; y < 512; ++y)
      for (int x = 0; x < 512; ++x)
        std::copy_n(solid.pictures[i].at(x * size / 512, y * size / 512), 4, large.at(x, y));
    write_png(folder / fmt::format("gso/cup/r_{:03}.png", i), large);
  }
  test::write_transforms(folder / "gso/cup", {{"frames", frames}});
  const DataSet set = open_data_set({folder / "gso"});
  EXPECT_EQ(names_of(set), (Names{"cup"}));
  EXPECT_STREQ(name_of(set.objects[0].layout), "gso");
  const Photographs read = open_object(set.objects[0]);
  ASSERT_EQ(read.set.views.size(), static_cast<std::size_t>(views));
  for (int i = 0; i < views; ++i) {
    EXPECT_EQ(read.set.views[i].camera.width, 512);
    const FramedView a = LoadedPhotograph(read, i).framed({7, Crop::automatic}),
                     b = LoadedPhotograph(solid.photographs, i).framed({7, Crop::automatic});
    EXPECT_NEAR(a.camera.fx, b.camera.fx, 1e-9);
    EXPECT_EQ(a.camera.w2c, b.camera.w2c);
    EXPECT_EQ(read.set.views[i].name, fmt::format("r_{:03}.png", i));
  }
  frames[3]["intrinsic_matrix"][0][1] = 2.5;
  test::write_transforms(folder / "gso/cup", {{"frames", frames}});
  expect_error(Status::input, {"object cup", "frame 3", "r_003.png", "intrinsic_matrix"},
               [&] { open_object(set.objects[0]); });
}

struct Damage {
  const char* what;
  std::function<void(Hdf5Writer& file, const Solid& solid)> write_third;  // view 2 of cup
  Status status;
  Names words;
};

std::vector<Damage> damages() {
  const auto rest = [](Hdf5Writer& f, const Solid& s, const Names& fields) {
    for (const std::string& field : fields) {
      if (field == "image") f.picture("cup/image_2", s.pictures[2]);
      if (field == "c2w") f.pose("cup/c2w_2", s.camera(2));
      if (field == "fov") f.numbers("cup/fov_2", {2}, {0.8, 0.8});
    }
  };
  const auto matrix = [](int index, double value) {
    std::vector<double> out = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, -2, 0, 0, 0, 1};
    out[static_cast<std::size_t>(index)] = value;
    return out;
  };
  return {{"no view 2", [](Hdf5Writer&, const Solid&) {}, Status::format, {"image_2", "not there"}},
          {"no picture",
           [=](auto& f, auto& s) {
             rest(f, s, {"c2w", "fov"});
           },
           Status::format,
           {"image_2", "not there"}},
          {"no pose",
           [=](auto& f, auto& s) {
             rest(f, s, {"image", "fov"});
           },
           Status::format,
           {"c2w_2", "not there"}},
          {"no field of view",
           [=](auto& f, auto& s) {
             rest(f, s, {"image", "c2w"});
           },
           Status::format,
           {"fov_2"}},
          {"no alpha",
           [=](auto& f, auto& s) {
             rest(f, s, {"c2w", "fov"}), f.picture("cup/image_2", Image(size, size, 3, 1));
           },
           Status::format,
           {"image_2", "12 x 12 x 3", "height x width x 4"}},
          {"a picture of floats",
           [=](auto& f, auto& s) {
             rest(f, s, {"c2w", "fov"});
             f.numbers("cup/image_2", {size, size, 4}, std::vector<double>(size * size * 4, 1));
           },
           Status::format,
           {"image_2", "unsigned integers of 8 bits"}},
          {"an empty picture",
           [=](auto& f, auto& s) {
             rest(f, s, {"c2w", "fov"}), f.picture("cup/image_2", Image(size, size, 4, 0));
           },
           Status::input,
           {"image_2", "alpha"}},
          {"a pose of 3 x 4",
           [=](auto& f, auto& s) {
             rest(f, s, {"image", "fov"}), f.numbers("cup/c2w_2", {3, 4}, std::vector<double>(12, 1));
           },
           Status::format,
           {"c2w_2", "3 x 4", "4 x 4"}},
          {"NaN in a pose",
           [=](auto& f, auto& s) {
             rest(f, s, {"image", "fov"}), f.numbers("cup/c2w_2", {4, 4}, matrix(3, NAN));
           },
           Status::input,
           {"c2w_2", "NaN", "finite"}},
          {"a pose that mirrors",
           [=](auto& f, auto& s) {
             rest(f, s, {"image", "fov"}), f.numbers("cup/c2w_2", {4, 4}, matrix(0, -1));
           },
           Status::input,
           {"c2w_2", "mirrors"}},
          {"a field of view in degrees",
           [=](auto& f, auto& s) {
             rest(f, s, {"image", "c2w"}), f.numbers("cup/fov_2", {2}, {49, 49});
           },
           Status::input,
           {"fov_2", "49", "radians"}},
          {"three angles",
           [=](auto& f, auto& s) {
             rest(f, s, {"image", "c2w"}), f.numbers("cup/fov_2", {3}, {1, 1, 1});
           },
           Status::format,
           {"fov_2", "shape is 3, 2 is expected"}}};
}

TEST(DataSetLayouts, NameWhatIsWrongInHdf5OrLeaveItOut) {
  const TemporaryFolder folder;
  const Solid solid(folder);
  for (const Damage& damage : damages()) {
    SCOPED_TRACE(damage.what);
    {
      Hdf5Writer file(folder / "set.h5");
      for (int i = 0; i < views; ++i)
        if (i != 2) file.view("cup", i, solid.pictures[i], solid.camera(i));
      damage.write_third(file, solid);
    }
    const DataSet set = open_data_set({folder / "set.h5"});
    const FrameRequest request{7, Crop::automatic, {}};
    Names words = damage.words;
    words.insert(words.end(), {"object cup", "view 2"});
    expect_error(damage.status, words, [&] {
      const FramedObject object = frame_object(set.objects[0], request);
      store_view(object, 2, request);
    });
    Names skipped;
    const Photographs rest = open_object(set.objects[0], &skipped);
    if (skipped.empty()) {  // found when the picture is decoded
      EXPECT_EQ(rest.set.views.size(), static_cast<std::size_t>(views));
      continue;
    }
    EXPECT_EQ(skipped.size(), 1u);
    ASSERT_EQ(rest.set.views.size(), static_cast<std::size_t>(views - 1));
    for (int i = 0; i < views - 1; ++i) {
      const int of = i < 2 ? i : i + 1;
      EXPECT_EQ(rest.set.views[i].name, fmt::format("image_{}", of));
      EXPECT_EQ(rest.picture(i).data, solid.pictures[of].data) << "pictures stay with their cameras";
    }
  }
}

TEST(DataSetLayouts, RefuseDamagedHdf5Files) {
  const TemporaryFolder folder;
  const Solid solid(folder);
  {
    Hdf5Writer file(folder / "whole.h5");
    solid.write(file, "cup");
    file.numbers("stray", {1}, {1});
  }
  const DataSet whole = open_data_set({folder / "whole.h5"});
  expect_error(Status::format, {"object stray", "whole.h5", "no group"}, [&] { open_object(whole.objects.at(1)); });
  test::put_file(folder / "text.h5", "this is no HDF5 file at all");
  expect_error(Status::format, {"text.h5", "not an HDF5 file"}, [&] { open_data_set({folder / "text.h5"}); });
  expect_error(Status::file, {"none.h5"}, [&] { open_data_set({folder / "none.h5"}); });
  const std::string bytes = test::contents_of(folder / "whole.h5");
  test::put_file(folder / "cut.h5", bytes.substr(0, bytes.size() / 2));
  expect_error(Status::format, {"cut.h5"}, [&] { open_data_set({folder / "cut.h5"}); });

  // Changes every 97th byte, one at a time: gives one of our errors or, if the byte does not matter, a picture.
  int errors = 0;
  for (std::size_t at = 0; at < bytes.size(); at += 97) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x5a);
    test::put_file(folder / "bits.h5", damaged);
    // Backdated, because a file that may still be written needs a new reader for each picture.
    fs::last_write_time(folder / "bits.h5", fs::last_write_time(folder / "whole.h5") - std::chrono::seconds(10 + at));
    try {
      for (const DataObject& object : open_data_set({folder / "bits.h5"}).objects) {
        if (object.name == "stray") continue;
        const FrameRequest request{7, Crop::automatic, {}};
        const FramedObject framed = frame_object(object, request);
        for (int i = 0; i < framed.views(); ++i) store_view(framed, i, request);
      }
    } catch (const Error& e) {
      EXPECT_TRUE(is_about_data(e)) << e.what();
      ++errors;
    }
  }
  EXPECT_GT(errors, 5);
}

TEST(Survey, TellsNumbersOfTheObject) {
  const TemporaryFolder folder;
  const std::string object = folder / "disc";
  fs::create_directories(object);
  nlohmann::json frames;
  const std::vector<Camera> cameras = test::ring(6, {1, 2, 3}, 4, 0);
  for (int i = 0; i < 6; ++i) {
    Image picture(40, 40 + i % 2, 4, 0.5f);  // alpha: the left half
    for (int y = 0; y < picture.height; ++y)
      for (int x = 0; x < 40; ++x) picture.at(x, y)[3] = x < 20 ? 1.0f : 0.0f;
    write_png(fmt::format("{}/{}.png", object, i), picture);
    Eigen::Matrix4d c2w = cameras[static_cast<std::size_t>(i)].c2w();
    c2w.middleCols<2>(1) *= -1;
    nlohmann::json rows;
    for (int r = 0; r < 4; ++r) rows.push_back({c2w(r, 0), c2w(r, 1), c2w(r, 2), c2w(r, 3)});
    frames.push_back({{"file_path", fmt::format("{}.png", i)}, {"fl_x", 20 + 10 * i}, {"transform_matrix", rows}});
  }
  nlohmann::json root = {{"frames", frames}, {"aabb_center", {1, 2, 3}}, {"aabb_half", 0.5}};
  test::write_transforms(object, root);
  const DataObject disc = open_data_set({object}).objects.at(0);
  ObjectSurvey found = survey(disc, 3);
  EXPECT_EQ(found.views, 6);
  EXPECT_TRUE(found.bad.empty());
  EXPECT_EQ(found.looked_at, 3);  // 0, 2, 4: the square ones, whole
  EXPECT_NEAR(found.coverage, 0.5, 1e-6);
  EXPECT_EQ(found.width.low, 40);
  EXPECT_EQ(found.height.high, 41);
  EXPECT_NEAR(found.fov.low, 2 * std::atan(20 / 70.0) * 180 / M_PI, 1e-9);
  EXPECT_NEAR(found.fov.high, 90, 1e-9);
  EXPECT_NEAR(found.distance.low, 4, 1e-9);
  EXPECT_NEAR(found.distance.high, 4, 1e-9);
  EXPECT_EQ(found.placement.centre, Eigen::Vector3d(1, 2, 3));
  write_png(object + "/2.png", Image(40, 40, 4, 0));
  fs::remove(object + "/5.png");
  found = survey(disc, -1);
  EXPECT_EQ(found.views, 5);
  EXPECT_EQ(found.looked_at, 4);
  ASSERT_EQ(found.bad.size(), 2u);
  EXPECT_NE(found.bad[0].find("5.png"), std::string::npos);
  EXPECT_NE(found.bad[1].find("alpha"), std::string::npos);
  EXPECT_EQ(survey(disc, 0).looked_at, 0);
}

TEST(Survey, SpreadsPictures) {
  using Indices = std::vector<int>;
  EXPECT_EQ(spread(4, 40), (Indices{0, 10, 20, 30}));
  EXPECT_EQ(spread(4, 3), (Indices{0, 1, 2}));
  EXPECT_EQ(spread(3, 7), (Indices{0, 2, 4}));
  EXPECT_TRUE(spread(0, 7).empty());
  EXPECT_TRUE(spread(4, 0).empty());
}

TEST(DataSetLayouts, SuggestTheOtherConvention) {
  const TemporaryFolder folder;
  const Solid solid(folder);
  {
    Hdf5Writer file(folder / "set.h5");
    for (int i = 0; i < views; ++i) {
      Camera inverted = solid.camera(i);
      inverted.w2c = inverted.c2w();
      file.view("cup", i, solid.pictures[i], inverted);
    }
  }
  expect_error(Status::input,
               {"object cup", "world-to-camera matrices (w2c) where the file's format has camera-to-world"}, [&] {
                 frame_object(open_data_set({folder / "set.h5"}).objects[0], FrameRequest{7, Crop::automatic, {}});
               });
}

}  // namespace
}  // namespace vsplat
