// Training on data sets with damage: named, or left out and counted.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "model/io/picture/image_file.h"
#include "tests/model/data/training_options.h"
#include "tests/support/data_sets.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using test::expect_error;
using test::kSide;
using test::options_of;
using test::same;
using test::TemporaryFolder;
using test::Warnings;

namespace fs = std::filesystem;

// One damage to solid_1 of three, and the text that the error must contain.
struct DamagedObject {
  const char* what;
  std::function<void(const std::string& folder)> apply;
  Status status;
  std::vector<std::string> words;
  int count;  // of bad things with skip_bad
};

void change_frame(const std::string& folder, const std::function<void(nlohmann::json&)>& change) {
  nlohmann::json root = test::read_transforms(folder);
  change(root["frames"][3]);
  test::write_transforms(folder, root);
}

std::vector<DamagedObject> damaged_objects() {
  const std::string third = "/images/0003.png";
  return {
      {"a picture is missing",
       [=](const std::string& f) { fs::remove(f + third); },
       Status::file,
       {"object solid_1", "images/0003.png", "picture is missing"},
       1},
      {"a picture is cut off",
       [=](const std::string& f) { test::put_file(f + third, test::contents_of(f + third).substr(0, 60)); },
       Status::format,
       {"object solid_1", "images/0003.png"},
       1},
      {"a picture has another shape",
       [=](const std::string& f) { write_png(f + third, Image(5, 9, 4, 1.0f)); },
       Status::input,
       {"object solid_1", "images/0003.png", "5 x 9", "12 x 12"},
       1},
      {"an alpha is empty",
       [=](const std::string& f) { write_png(f + third, Image(kSide, kSide, 4, 0.0f)); },
       Status::input,
       {"object solid_1", "images/0003.png", "alpha"},
       1},
      {"a mask is missing",
       [](const std::string& f) { change_frame(f, [](nlohmann::json& v) { v["mask_path"] = "gone.png"; }); },
       Status::file,
       {"object solid_1", "images/0003.png", "mask", "gone.png"},
       1},
      {"a pose is NaN",
       [](const std::string& f) { change_frame(f, [](nlohmann::json& v) { v["transform_matrix"][1][2] = "NaN"; }); },
       Status::input,
       {"object solid_1", "frame 3", "images/0003.png", "transform_matrix"},
       1},
      {"a pose has three columns",
       [](const std::string& f) { change_frame(f, [](nlohmann::json& v) { v["transform_matrix"][1].erase(0); }); },
       Status::format,
       {"object solid_1", "frame 3", "transform_matrix"},
       1},
      {"the list is cut off",
       [](const std::string& f) {
         test::put_file(f + "/transforms.json", test::contents_of(f + "/transforms.json").substr(0, 500));
       },
       Status::format,
       {"object solid_1", "transforms.json"},
       1},
      {"too few views",
       [](const std::string& f) {
         nlohmann::json root = test::read_transforms(f);
         root["frames"].erase(root["frames"].begin() + 3, root["frames"].end());
         test::write_transforms(f, root);
       },
       Status::input,
       {"object solid_1", "3 of its 3 views", "4 input views"},
       1},
      {"the cube is elsewhere",
       [](const std::string& f) {
         nlohmann::json root = test::read_transforms(f);
         root["aabb_center"] = {0, 50, 0};
         test::write_transforms(f, root);
       },
       Status::input,
       {"object solid_1", "centre"},
       1},
      {"the cube reaches the cameras",
       [](const std::string& f) {
         nlohmann::json root = test::read_transforms(f);
         root["aabb_half"] = 3;
         test::write_transforms(f, root);
       },
       Status::input,
       {"object solid_1", "behind the camera"},
       1}};
}

TEST(TrainingReader, NamesBadDataOrCountsItAndGoesOn) {
  for (const DamagedObject& damage : damaged_objects()) {
    SCOPED_TRACE(damage.what);
    const TemporaryFolder folder;
    test::write_solids(folder, 3, 9, kSide);
    damage.apply(folder / "solid_1");
    const auto read = [&](TrainingReader& reader) {
      std::vector<TrainingViews> out;
      for (long step = 0; step < 12; ++step) out.push_back(reader.at(step, 0));
      return out;
    };
    TrainingOptions options = options_of();
    TrainingReader strict(open_data_set({folder.string()}), options);
    expect_error(damage.status, damage.words, [&] { read(strict); });
    options.skip_bad = true;
    const Warnings warnings;
    TrainingReader lenient(open_data_set({folder.string()}), options);
    const std::vector<TrainingViews> first = read(lenient);
    options.threads = 2;
    options.cache_bytes = 0;
    TrainingReader threaded(open_data_set({folder.string()}), options);
    const std::vector<TrainingViews> second = read(threaded);
    for (std::size_t i = 0; i < first.size(); ++i) {
      EXPECT_TRUE(same(first[i], second[i])) << i;
      for (const Camera& camera : first[i].cameras)
        EXPECT_FALSE(first[i].object == "solid_1" && camera.file == "images/0003.png") << i;
    }
    EXPECT_EQ(lenient.bad(), damage.count);
    EXPECT_EQ(threaded.bad(), damage.count);
    EXPECT_GE(warnings.all.size(), 1u);
  }
}

TEST(TrainingReader, SaysSoWhereNothingIsLeft) {
  const TemporaryFolder folder;
  test::write_solids(folder, 1, 9, kSide);
  fs::remove_all(folder / "solid_0/images");
  TrainingOptions options = options_of();
  options.skip_bad = true;
  TrainingReader reader(open_data_set({folder.string()}), options);
  expect_error(Status::input, {"none of the 1 objects"}, [&] { reader.at(0, 0); });
}

TEST(TrainingReader, RefusesOptionsThatMakeNoSense) {
  const TemporaryFolder folder;
  test::write_solids(folder, 1, 8, 8);
  const auto refused = [&](const std::function<void(TrainingOptions&)>& change, const std::string& word) {
    TrainingOptions options = options_of();
    change(options);
    expect_error(Status::usage, {word}, [&] { TrainingReader(open_data_set({folder.string()}), options); });
  };
  refused([](TrainingOptions& o) { o.image = 0; }, "size");
  refused([](TrainingOptions& o) { o.min_inputs = 0; }, "input views");
  refused([](TrainingOptions& o) { o.min_inputs = 5; }, "input views");
  refused([](TrainingOptions& o) { o.rebase = "spin"; }, "rebase");
  refused([](TrainingOptions& o) { o.min_cube = 0; }, "cube");
  refused([](TrainingOptions& o) { o.turn_degrees = NAN; }, "turn");
  refused([](TrainingOptions& o) { o.mirror = 1.5; }, "mirrored");
  refused([](TrainingOptions& o) { o.shuffle_channels = NAN; }, "colours");
  refused([](TrainingOptions& o) { o.rooms = -0.1; }, "room");
  expect_error(Status::input, {"no objects"}, [] { TrainingReader(DataSet(), options_of()); });
}

}  // namespace
}  // namespace vsplat
