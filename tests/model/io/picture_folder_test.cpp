#include "model/io/picture_folder.h"

#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using test::expect_error;

TEST(PictureFolder, FindsByStem) {
  const test::ViewFolder folder;
  for (const char* name : {"a.png", "b.JPG", "c.exr", "d.txt", "e.f.png", "g", "0007.jpeg"}) folder.touch(name);
  const auto found = [&](const char* name) { return find_picture(folder.path(), name).filename().string(); };
  EXPECT_EQ(found("a.png"), "a.png");
  EXPECT_EQ(found("images/a.jpg"), "a.png");
  EXPECT_EQ(found("/somewhere/else/b.png"), "b.JPG");
  EXPECT_EQ(found("../c"), "c.exr");
  EXPECT_EQ(found("d"), "");  // no picture
  EXPECT_EQ(found("d.txt"), "");
  EXPECT_EQ(found("e.f"), "e.f.png");
  EXPECT_EQ(found("e.f.jpg"), "e.f.png");
  EXPECT_EQ(found("e.png"), "");
  EXPECT_EQ(found("g"), "");
  EXPECT_EQ(found("0007"), "0007.jpeg");
  EXPECT_EQ(found("A.png"), "");
}

TEST(PictureFolder, LooksInTheFoldersOfTheName) {
  const test::ViewFolder folder;
  folder.touch("left/1.png");
  folder.touch("right/1.png");
  folder.touch("1.png");
  EXPECT_EQ(find_picture(folder.path(), "right/1.jpg"), folder / "right/1.png");
  EXPECT_EQ(find_picture(folder.path(), "./left/1"), folder / "left/1.png");
  EXPECT_EQ(find_picture(folder.path(), "middle/1.png"), folder / "1.png");
  EXPECT_EQ(find_picture(folder / "left", "../right/1.png"), folder / "left/1.png");  // never out of the folder
}

TEST(PictureFolder, OneOfSeveralMustBeMeant) {
  const test::ViewFolder folder;
  folder.touch("a.png");
  folder.touch("a.jpg");
  EXPECT_EQ(find_picture(folder.path(), "a.jpg"), folder / "a.jpg");
  expect_error(Status::input, {"a.jpg", "a.png", folder.string()}, [&] { find_picture(folder.path(), "a.exr"); });
  expect_error(Status::file, {"nowhere"}, [&] { find_picture(folder / "nowhere", "a"); });
  expect_error(Status::file, {"a.png"}, [&] { find_picture(folder / "a.png", "a"); });
}

}  // namespace
}  // namespace vsplat
