// Reading data sets for training: the same pictures as in `reconstruct`, the same choice however it is read, bad data.
#include "model/data/training_views.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>

#include "model/base/resample.h"
#include "model/data/drawn_views.h"
#include "model/data/random_object.h"
#include "model/io/picture/image_file.h"
#include "model/networks/params/config.h"
#include "model/views/view_choice.h"
#include "tests/model/data/training_options.h"
#include "tests/support/data_sets.h"
#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using Eigen::Vector3d;
using test::expect_error;
using test::kSide;
using test::options_of;
using test::same;
using test::TemporaryFolder;
using test::Warnings;

std::vector<float> picture(const TrainingViews& views, std::size_t index, int image) {
  const auto pixels = static_cast<std::ptrdiff_t>(image) * image * 3;
  const auto begin = views.pictures.begin() + static_cast<std::ptrdiff_t>(index) * pixels;
  return {begin, begin + pixels};
}

// Compares `reconstruct`'s network input for the drawn views with the reader's output.
void expect_as_reconstructed(const std::string& folder, const TrainingOptions& options, double tolerance) {
  const TrainingViews read = TrainingReader(open_data_set({folder}), options).at(3, 0);
  Config config = named_config("micro");
  config.image = options.image;
  config.rebase = options.rebase;
  InputRequest request;
  request.crop = options.crop;
  request.placement = options.placement;
  for (const Camera& camera : read.cameras) request.names.push_back(camera.file);
  const Photographs photographs{read_views(fs::path(folder) / read.object), {}};
  const Input input = prepare_input(photographs, config.taken(), request);
  const PlacedViews placed = place_views(cameras_of(input), input.placement, options.rebase);
  ASSERT_EQ(read.cameras.size(), 8u);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(read.cameras[i].w2c, placed.cameras[i].w2c) << i;
    EXPECT_EQ(read.cameras[i].fx, placed.cameras[i].fx) << i;
    EXPECT_EQ(read.cameras[i].cy, placed.cameras[i].cy) << i;
    const std::vector<float> a = picture(read, i, options.image), &b = input.views[i].image.data;
    ASSERT_EQ(a.size(), b.size());
    double most = 0;
    for (std::size_t k = 0; k < a.size(); ++k) most = std::max(most, std::abs(static_cast<double>(a[k]) - b[k]));
    EXPECT_LE(most, tolerance) << i;
    EXPECT_LT(*std::min_element(b.begin(), b.end()), 0.9f) << "an empty picture says nothing";
  }
}

TEST(TrainingReader, GivesWhatReconstructFeedsTheNetwork) {
  const TemporaryFolder folder;
  test::write_solids(folder, 2, 12, kSide);
  expect_as_reconstructed(folder.string(), options_of(), 0);
  TrainingOptions options = options_of();
  options.rebase = "move";
  options.placement.edge = 1.3;
  options.placement.centre = Vector3d(0.1, 0, -0.1);
  expect_as_reconstructed(folder.string(), options, 0);
  options.image = 7;  // resampled: the 8-bit rounding of colour and alpha is visible
  options.crop = Crop::object;
  expect_as_reconstructed(folder.string(), options, 1.01 / 255);
}

TEST(TrainingReader, ReadsMasksAndLensesAsReconstructDoes) {
  const TemporaryFolder folder;
  const std::string object = folder / "vase";
  fs::create_directories(object);
  nlohmann::json root = {{"k1", 0.1}, {"aabb_half", 0.4}, {"aabb_center", {0.05, 0.0, 0.0}}};
  root["frames"] = nlohmann::json::array();
  int number = 0;
  for (const Camera& camera : test::ring(9)) {
    Image photo(32, 24, 3), mask(32, 24, 1);
    for (int y = 0; y < 24; ++y)
      for (int x = 0; x < 32; ++x) {
        for (int c = 0; c < 3; ++c) photo.at(x, y)[c] = 0.1f * static_cast<float>((x * (c + 1) + y * 3 + number) % 9);
        *mask.at(x, y) = std::hypot(x - 16, y - 12) < 6 ? 1.0f : 0.0f;
      }
    const std::string name = fmt::format("{}.png", number++);
    write_png(object + "/" + name, photo);
    write_png(object + "/mask_" + name, mask);
    Eigen::Matrix4d c2w = camera.c2w();
    c2w.middleCols<2>(1) *= -1;
    nlohmann::json rows;
    for (int r = 0; r < 4; ++r) rows.push_back({c2w(r, 0), c2w(r, 1), c2w(r, 2), c2w(r, 3)});
    root["frames"].push_back(
        {{"file_path", name}, {"mask_path", "mask_" + name}, {"fl_x", 40}, {"transform_matrix", rows}});
  }
  test::write_transforms(object, root);
  expect_as_reconstructed(folder.string(), options_of(10), 1.01 / 255);
}

TEST(TrainingReader, DependsOnTheSeedAndTheStepAlone) {
  const TemporaryFolder folder;
  test::write_solids(folder, 3, 11, kSide);
  TrainingOptions options = options_of();
  options.batch = 2;
  options.min_inputs = 2;
  options.random_background = true;
  options.turn_degrees = 20;
  options.mirror = 0.5, options.shuffle_channels = 0.5, options.rooms = 0.5;
  options.min_cube = 0.8, options.max_cube = 1.2;
  TrainingReader plain(open_data_set({folder.string()}), options);
  TrainingOptions hurried = options;
  hurried.threads = 3;
  hurried.cache_bytes = 10 * kSide * kSide * 4;  // far less than the data need
  TrainingReader threaded(open_data_set({folder.string()}), hurried);
  hurried.cache_bytes = 0;
  hurried.ahead = 0;
  TrainingReader bare(open_data_set({folder.string()}), hurried);
  std::vector<TrainingViews> first;
  std::set<int> inputs;
  for (long step = 0; step < 6; ++step)
    for (int item = 0; item < 2; ++item) {
      first.push_back(plain.at(step, item));
      inputs.insert(first.back().inputs);
      EXPECT_TRUE(same(first.back(), threaded.at(step, item))) << step << " " << item;
      EXPECT_LE(threaded.cached_bytes(), 10u * kSide * kSide * 4);
      EXPECT_EQ(first.back().cameras.size(), static_cast<std::size_t>(first.back().inputs) + 4);
    }
  EXPECT_EQ(inputs, (std::set<int>{2, 3, 4}));
  for (const int number : {9, 2, 11, 0, 3})  // out of order, forwards and backwards
    for (TrainingReader* reader : {&plain, &threaded, &bare})
      EXPECT_TRUE(same(reader->at(number / 2, number % 2), first[static_cast<std::size_t>(number)])) << number;
  options.seed = 5;
  TrainingReader other(open_data_set({folder.string()}), options);
  EXPECT_FALSE(same(other.at(0, 0), first[0]) && same(other.at(0, 1), first[1]));
  EXPECT_FALSE(same(first[0], first[6])) << "the next round of the objects has other views";
}

// For pictures with alpha, the pictures are the colours over the background. An opaque picture has no alpha.
TEST(TrainingReader, GivesAlphaWhereItIsAskedFor) {
  const TemporaryFolder folder;
  test::write_solids(folder, 1, 11, kSide);
  TrainingOptions options = options_of();
  options.random_background = true;
  EXPECT_TRUE(TrainingReader(open_data_set({folder.string()}), options).at(0, 0).rgba.empty());
  options.alpha = true;
  for (long step = 0; step < 3; ++step) {
    const TrainingViews views = TrainingReader(open_data_set({folder.string()}), options).at(step, 0);
    ASSERT_EQ(views.rgba.size(), views.cameras.size());
    std::size_t covered = 0;
    for (std::size_t v = 0; v < views.rgba.size(); ++v) {
      const float shade = static_cast<int>(v) < views.inputs ? 1.0f : views.background[0];
      ASSERT_EQ(views.rgba[v].size(), static_cast<std::size_t>(4 * kSide * kSide));
      for (std::size_t i = 0; i < std::size_t{kSide} * std::size_t{kSide}; ++i) {
        const std::uint8_t* p = &views.rgba[v][4 * i];
        const float* picture = &views.pictures[3 * (v * static_cast<std::size_t>(kSide * kSide) + i)];
        covered += p[3] == 255 ? 1 : 0;
        for (int c = 0; c < 3; ++c)
          ASSERT_NEAR(static_cast<float>(p[c] + (255 - p[3]) * shade) / 255, picture[c], 1.01 / 255);
      }
    }
    EXPECT_GT(covered, 0u);
    EXPECT_LT(covered, views.rgba.size() * kSide * kSide);
  }
}

TEST(TrainingReader, KeepsWhatItHasDecoded) {
  const TemporaryFolder folder;
  test::write_solids(folder, 1, 8, kSide);
  TrainingReader reader(open_data_set({folder.string()}), options_of());
  const TrainingViews before = reader.at(0, 0);
  EXPECT_GE(reader.cached_bytes(), 8u * kSide * kSide * 4);
  fs::remove_all(folder / "solid_0/images");
  EXPECT_TRUE(same(reader.at(0, 0), before)) << "all eight views are in every step";
}

// An unmasked photograph does not mark the object, neither where it is opaque nor where it ends.
TEST(TrainingReader, TakesTheEndOfAPhotographForNeitherAlphaNorBackground) {
  const TemporaryFolder folder;
  test::write_solids(folder, 1, 9, kSide);
  TrainingOptions options = options_of();
  options.alpha = true, options.crop = Crop::pad;
  EXPECT_FALSE(TrainingReader(open_data_set({folder.string()}), options).at(0, 0).rgba.front().empty());
  test::take_alpha(folder, 1);
  const TrainingViews plain = TrainingReader(open_data_set({folder.string()}), options).at(0, 0);
  for (const auto& rgba : plain.rgba) EXPECT_TRUE(rgba.empty());
  options.rooms = 1;
  EXPECT_EQ(TrainingReader(open_data_set({folder.string()}), options).at(0, 0).pictures, plain.pictures);
}

TEST(TrainingReader, TakesEveryObjectOnceARound) {
  const TemporaryFolder folder;
  test::write_solids(folder, 5, 8, 8);
  TrainingReader reader(open_data_set({folder.string()}), options_of(8));
  std::vector<std::string> order;
  for (long step = 0; step < 15; ++step) order.push_back(reader.at(step, 0).object);
  for (int round = 0; round < 3; ++round)
    EXPECT_EQ(std::set<std::string>(order.begin() + 5 * round, order.begin() + 5 * round + 5).size(), 5u);
  EXPECT_FALSE(std::equal(order.begin(), order.begin() + 5, order.begin() + 5) &&
               std::equal(order.begin(), order.begin() + 5, order.begin() + 10));
}

// Procedural objects are inserted between those of the set, whose order and views do not change; they equal the
// command's output for the same numbers; neither threads nor the order of requests change a bit.
TEST(TrainingReader, DrawsProceduralObjectsBetweenThoseOfTheSet) {
  const TemporaryFolder folder;
  test::write_solids(folder, 3, 9, kSide);
  TrainingOptions options = options_of();
  options.random_background = true;
  options.alpha = true;
  options.batch = 2;
  TrainingReader without(open_data_set({folder.string()}), options);
  options.procedural = 0.4;
  TrainingReader plain(open_data_set({folder.string()}), options);
  TrainingOptions hurried = options;
  hurried.threads = 3;
  TrainingReader threaded(open_data_set({folder.string()}), hurried);
  std::vector<TrainingViews> all;
  std::size_t others = 0;
  for (int number = 0; number < 20; ++number) {
    all.push_back(plain.at(number / 2, number % 2));
    EXPECT_TRUE(same(all.back(), threaded.at(number / 2, number % 2))) << number;
    if (all.back().object == fmt::format("procedural {}", number)) continue;
    EXPECT_EQ(all.back().object, without.at(static_cast<long>(others) / 2, static_cast<int>(others % 2)).object);
    ++others;
  }
  EXPECT_EQ(others, 12u);
  for (const int number : {17, 4, 11, 2, 5})
    for (TrainingReader* reader : {&plain, &threaded})
      EXPECT_TRUE(same(reader->at(number / 2, number % 2), all[static_cast<std::size_t>(number)])) << number;

  const TemporaryFolder written;
  ObjectOptions object;
  object.views = 40, object.size = kSide, object.seed = options.seed, object.object = 2;  // the number of the first one
  ASSERT_EQ(all[2].object, "procedural 2");
  write_object(written / "object_0002", random_object(options.seed, 2, nullptr), object);
  for (std::size_t i = 0; i < all[2].cameras.size(); ++i) {
    const Image stored = read_image(written / ("object_0002/" + all[2].cameras[i].file));
    const float shade = static_cast<int>(i) < all[2].inputs ? 1.0f : all[2].background[0];
    const Image flat = over(premultiplied(stored), {shade, shade, shade});
    const std::vector<float> drawn = picture(all[2], i, kSide);
    for (std::size_t k = 0; k < drawn.size(); ++k) ASSERT_NEAR(drawn[k], flat.data[k], 1.01 / 255) << i << " " << k;
  }
}

TEST(TrainingReader, NeedsNoSetWhereAllIsProcedural) {
  TrainingOptions options = options_of();
  options.procedural = 1;
  TrainingReader reader(DataSet(), options);
  EXPECT_EQ(reader.at(0, 0).object, "procedural 0");
  EXPECT_EQ(reader.at(7, 0).object, "procedural 7");
  options.procedural = 0.9;
  expect_error(Status::input, {"no objects"}, [&] { TrainingReader(DataSet(), options); });
  options.procedural = 1.1;
  expect_error(Status::usage, {"0 to 1"}, [&] { TrainingReader(DataSet(), options); });
}

// An unreadable texture is an error, or is skipped like other bad data.
TEST(TrainingReader, NamesTexturesThatCannotBeRead) {
  const TemporaryFolder folder;
  test::put_file(folder / "broken.png", "no picture");
  TrainingOptions options = options_of();
  options.procedural = 1;
  options.textures = folder / "gone";
  expect_error(Status::file, {"gone"}, [&] { TrainingReader(DataSet(), options); });
  options.textures = folder.string();
  TrainingReader strict(DataSet(), options);
  expect_error(Status::format, {"broken.png"}, [&] {
    for (long step = 0; step < 9; ++step) strict.at(step, 0);
  });
  const Warnings warnings;
  options.skip_bad = true;
  TrainingReader lenient(DataSet(), options);
  for (long step = 0; step < 9; ++step) EXPECT_EQ(lenient.at(step, 0).object, fmt::format("procedural {}", step));
  EXPECT_EQ(lenient.bad(), 1);
}

TEST(TrainingReader, PutsNovelViewsAloneOnTheBackground) {
  const TemporaryFolder folder;
  test::write_solids(folder, 1, 10, kSide);
  TrainingOptions options = options_of();
  options.random_background = true;
  TrainingReader reader(open_data_set({folder.string()}), options);
  std::set<float> seen;
  for (long step = 0; step < 20; ++step) {
    const TrainingViews views = reader.at(step, 0);
    seen.insert(views.background[0]);
    for (std::size_t i = 0; i < 8; ++i) {
      const std::vector<float> p = picture(views, i, kSide);
      EXPECT_EQ(p[0], i < 4 ? 1.0f : views.background[0]);  // a corner
    }
  }
  EXPECT_EQ(seen, (std::set<float>{0.0f, 0.5f, 1.0f}));
  for (const auto& entry : fs::directory_iterator(folder / "solid_0/images")) {  // no alpha: the background is not
                                                                                 // visible
    const Image rgba = read_image(entry.path().string());
    Image rgb(kSide, kSide, 3, 0.25f);
    for (int i = 0; i < kSide * kSide; ++i) std::copy_n(&rgba.data[4 * i], 3, &rgb.data[3 * i]);
    write_png(entry.path().string(), rgb);
  }
  TrainingReader opaque(open_data_set({folder.string()}), options);
  for (long step = 0; step < 9; ++step) EXPECT_EQ(opaque.at(step, 0).background[0], 1.0f);
}

TEST(TrainingReader, TurnsAndScalesTheFrame) {
  const TemporaryFolder folder;
  test::write_solids(folder, 1, 10, kSide);
  TrainingOptions options = options_of();
  TrainingReader plain(open_data_set({folder.string()}), options);
  options.turn_degrees = 30;
  options.min_cube = 0.8, options.max_cube = 1.2;
  TrainingReader moved(open_data_set({folder.string()}), options);
  double most = 0, smallest = 9, largest = 0;
  for (long step = 0; step < 30; ++step) {
    const TrainingViews a = plain.at(step, 0), b = moved.at(step, 0);
    ASSERT_EQ(a.pictures, b.pictures) << "the same views are drawn";
    const Eigen::Matrix3d turn = b.cameras[0].w2c.topLeftCorner<3, 3>();  // that of `a` is the identity
    most = std::max(most, Eigen::AngleAxisd(turn).angle() * 180 / M_PI);
    const double scale = b.cameras[0].centre().norm() / a.cameras[0].centre().norm();
    smallest = std::min(smallest, 1 / scale), largest = std::max(largest, 1 / scale);
    for (std::size_t i = 0; i < 8; ++i) {
      const Eigen::Matrix3d was = a.cameras[i].w2c.topLeftCorner<3, 3>(), is = b.cameras[i].w2c.topLeftCorner<3, 3>();
      EXPECT_TRUE(is.isApprox(was * turn, 1e-9));
      EXPECT_TRUE(b.cameras[i].centre().isApprox(scale * (turn.transpose() * a.cameras[i].centre()), 1e-9));
      EXPECT_EQ(a.cameras[i].fx, b.cameras[i].fx);
    }
  }
  EXPECT_GT(most, 15);
  EXPECT_LE(most, 30);
  EXPECT_GE(smallest, 0.8);
  EXPECT_LT(smallest, 0.95);
  EXPECT_LE(largest, 1.2);
  EXPECT_GT(largest, 1.05);
}

TEST(Shuffled, IsAPermutationThatChangesWithSeedAndRound) {
  for (const std::uint64_t count : {1u, 2u, 3u, 4u, 5u, 7u, 16u, 17u, 64u, 65u, 1000u}) {
    std::set<std::uint64_t> seen;
    std::uint64_t moved = 0, differs = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      const std::uint64_t to = shuffled(i, count, 3, 1);
      EXPECT_LT(to, count);
      seen.insert(to);
      moved += to != i ? 1 : 0;
      differs += to != shuffled(i, count, 3, 2) && to != shuffled(i, count, 4, 1) ? 1 : 0;
    }
    EXPECT_EQ(seen.size(), count);
    if (count < 64) continue;
    EXPECT_GT(moved, count * 9 / 10);
    EXPECT_GT(differs, count * 9 / 10);
  }
}

TEST(DrawViews, TakesOneOfEachGroupAndNoneTwice) {
  std::vector<Vector3d> positions;  // four clusters of 3
  for (const Vector3d& heap : {Vector3d(5, 0, 0), Vector3d(-5, 0, 0), Vector3d(0, 5, 0), Vector3d(0, 0, 5)})
    for (int i = 0; i < 3; ++i) positions.push_back(heap + Vector3d(0.1 * i, 0.05 * i * i, 0));
  std::vector<bool> excluded(12, false);
  excluded[4] = true;
  std::set<int> reference, drawn;
  Random random(1, 2, draw_stream);
  for (int i = 0; i < 200; ++i) {
    const DrawnViews views = draw_views(positions, excluded, 4, 4, false, random);
    for (const std::vector<int>* four : {&views.inputs, &views.novel}) {
      std::set<int> heaps;
      for (const int v : *four) heaps.insert(v / 3);
      EXPECT_EQ(heaps.size(), 4u);
    }
    std::set<int> all(views.inputs.begin(), views.inputs.end());
    all.insert(views.novel.begin(), views.novel.end());
    EXPECT_EQ(all.size(), 8u);
    EXPECT_EQ(all.count(4), 0u);
    reference.insert(views.inputs[0]);
    drawn.insert(all.begin(), all.end());
  }
  EXPECT_EQ(drawn.size(), 11u) << "every view has its turn";
  EXPECT_EQ(reference.size(), 11u) << "as the reference, too";
}

TEST(DrawViews, TakesTheFirstListedOfEachGroup) {
  std::vector<Vector3d> positions;  // four clusters of 6
  for (const Vector3d& heap : {Vector3d(5, 0, 0), Vector3d(-5, 0, 0), Vector3d(0, 5, 0), Vector3d(0, 0, 5)})
    for (int i = 0; i < 6; ++i) positions.push_back(heap + Vector3d(0.1 * i, 0.05 * i * i, 0));
  std::vector<bool> excluded(24, false);
  excluded[6] = true;
  std::vector<int> times(24, 0), references(4, 0);
  Random random(1, 2, draw_stream);
  for (int i = 0; i < 400; ++i) {
    const DrawnViews views = draw_views(positions, excluded, 4, 4, true, random);
    ASSERT_EQ(views.inputs.size(), 4u);
    ASSERT_EQ(views.novel.size(), 4u);
    std::set<int> all(views.inputs.begin(), views.inputs.end());
    all.insert(views.novel.begin(), views.novel.end());
    EXPECT_EQ(all.size(), 8u);
    for (const int v : views.inputs) ++times[static_cast<std::size_t>(v)];
    ++references[static_cast<std::size_t>(views.inputs[0] / 6)];
  }
  EXPECT_EQ(times[6], 0);
  for (const int heap : {0, 12, 18}) {  // half of the time the first is among the half, else the second, ...
    EXPECT_GT(times[static_cast<std::size_t>(heap)], 140);
    EXPECT_GT(times[static_cast<std::size_t>(heap)], times[static_cast<std::size_t>(heap + 1)]);
    EXPECT_GT(times[static_cast<std::size_t>(heap + 1)], times[static_cast<std::size_t>(heap + 3)]);
  }
  for (const int count : references) EXPECT_GT(count, 60) << "any of them may be the reference";
}

TEST(DrawViews, MakesDoWithFewViews) {
  for (const int inputs : {1, 2, 4, 5}) {
    Random random(1, 2, draw_stream);
    const std::vector<Vector3d> places = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}};
    const DrawnViews views = draw_views(places, std::vector<bool>(5, false), inputs, 2, true, random);
    EXPECT_EQ(std::set<int>(views.inputs.begin(), views.inputs.end()).size(), static_cast<std::size_t>(inputs));
  }

  Random random(1, 2, draw_stream);
  std::vector<Vector3d> positions = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {-1, 0, 0}, {0, -1, 0}};
  DrawnViews views = draw_views(positions, std::vector<bool>(5, false), 4, 4, false, random);
  EXPECT_EQ(std::set<int>(views.inputs.begin(), views.inputs.end()).size(), 4u);
  ASSERT_EQ(views.novel.size(), 4u);
  EXPECT_EQ(std::count(views.inputs.begin(), views.inputs.end(), views.novel[0]), 0) << "the one that is left is first";
  EXPECT_TRUE(draw_views(positions, {true, true, false, false, false}, 4, 4, false, random).inputs.empty());
  positions.assign(6, Vector3d(1, 2, 3));  // one place, one group
  views = draw_views(positions, std::vector<bool>(6, false), 4, 2, false, random);
  EXPECT_EQ(std::set<int>(views.inputs.begin(), views.inputs.end()).size(), 4u);
  EXPECT_EQ(views.novel.size(), 2u);
}

TEST(DataSet, FindsObjectsAndNamesThemByTheirFolders) {
  const TemporaryFolder folder;
  test::write_solids(folder, 2, 1, 8);
  fs::create_directories(folder / "more/deep");
  fs::create_directories(folder / ".hidden");
  fs::copy(folder / "solid_1", folder / "more/deep/solid_1", fs::copy_options::recursive);
  fs::copy(folder / "solid_1", folder / ".hidden/solid_7", fs::copy_options::recursive);
  const auto names = [](const DataSet& set) {
    std::vector<std::string> out;
    for (const DataObject& object : set.objects) out.push_back(object.name);
    return out;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(names(open_data_set({folder.string()})), (Names{"solid_1", "solid_0", "solid_1_2"}));
  EXPECT_EQ(names(open_data_set({folder / "solid_0/", folder / "more"})), (Names{"solid_0", "solid_1"}));
  EXPECT_EQ(names(open_data_set({folder / "solid_0/images/.."})), (Names{"solid_0"}));
  expect_error(Status::file, {"nowhere"}, [&] { open_data_set({folder / "nowhere"}); });
  expect_error(Status::input, {"images", "no object"}, [&] { open_data_set({folder / "solid_0/images"}); });
}

}  // namespace
}  // namespace vsplat
