#include "model/io/views/listed_file.h"

#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

using test::expect_error;

class ListedFile : public ::testing::Test {
 protected:
  // With a folder named by the user.
  FoundFile below(const std::string& name) { return ListedFiles({folder.path()}).find(name); }
  // With the list's own folder.
  FoundFile beside(const std::string& name) { return ListedFiles({folder.path()}, folder.path()).find(name); }
  void expect_file(const std::string& name, const std::string& file, bool exactly) {
    for (const FoundFile& found : {below(name), beside(name)}) {
      EXPECT_EQ(found.path.lexically_normal(), (folder / file).lexically_normal()) << name;
      EXPECT_EQ(found.exactly, exactly) << name;
    }
  }
  test::ViewFolder folder;
};

TEST_F(ListedFile, AsListedThenByShorterTails) {
  folder.touch("images/front/1.png");
  folder.touch("2.png");
  expect_file("images/front/1.png", "images/front/1.png", true);
  expect_file("./images/front/1.png", "images/front/1.png", true);
  expect_file("set/images/front/1.png", "images/front/1.png", false);
  expect_file("/home/somebody/set/images/front/1.png", "images/front/1.png", false);
  expect_file("C:\\Users\\somebody\\set\\images\\front\\1.png", "images/front/1.png", false);
  expect_file("images\\front\\1.png", "images/front/1.png", true);
  expect_file("../elsewhere/2.png", "2.png", false);
  EXPECT_TRUE(below("1.png").path.empty()) << "not in folders that the list does not name";
}

TEST_F(ListedFile, ByStemWithAnotherEndingOrCase) {
  for (const char* name : {"a.png", "b.JPG", "c.exr", "d.txt", "e.f.png", "0007.jpeg", "Folder/K.TIFF"})
    folder.touch(name);
  expect_file("a.jpg", "a.png", false);
  expect_file("a", "a.png", false);
  expect_file("images/a.jpg", "a.png", false);
  expect_file("b.jpg", "b.JPG", false);
  expect_file("b.png", "b.JPG", false);
  expect_file("A.PNG", "a.png", false);
  expect_file("e.f", "e.f.png", false);
  expect_file("e.f.jpg", "e.f.png", false);
  expect_file("0007", "0007.jpeg", false);
  expect_file("folder/k.png", "Folder/K.TIFF", false);
  expect_file("IMG/0007.HEIC", "0007.jpeg", false);  // the picture was converted, the list was not
  expect_file("b.dng", "b.JPG", false);
  EXPECT_TRUE(below("d").path.empty()) << "no picture";
  EXPECT_TRUE(below("e.png").path.empty());
  EXPECT_TRUE(below("").path.empty());
}

TEST_F(ListedFile, ByNamesOfOtherPrograms) {
  for (const char* name : {"my photo.png", "50%.png", "a%20b.png", "c.jfif", "D.JPE"}) folder.touch(name);
  expect_file("my%20photo.png", "my photo.png", false);
  expect_file("file:///home/me/set/my%20photo.PNG", "my photo.png", false);
  expect_file("images/my%20photo.jpg", "my photo.png", false);
  expect_file("50%.png", "50%.png", true);
  expect_file("50%25.png", "50%.png", false);
  expect_file("a%20b.png", "a%20b.png", true);  // as listed comes first
  expect_file(" my photo.png", "my photo.png", false);
  expect_file("my photo.png\r\n", "my photo.png", false);
  expect_file("c.jpg", "c.jfif", false);
  expect_file("d", "D.JPE", false);
  for (const char* name : {"%", "%2", "%zz.png", "my%00photo.png", " ", "%20"})
    EXPECT_TRUE(below(name).path.empty()) << name;
  EXPECT_TRUE(below("%2e%2e/%2e%2e/etc/passwd").path.empty());
}

TEST_F(ListedFile, AnExactTailComesBeforeAnotherEnding) {
  folder.touch("cam/1.jpg");
  folder.touch("1.png");
  expect_file("cam/1.png", "1.png", false);
  expect_file("cam/1.jpg", "cam/1.jpg", true);
}

TEST_F(ListedFile, LongNamesTakeNoTime) {
  folder.touch("x/1.png");
  std::string deep;
  for (int i = 0; i < 1000; ++i) deep += "a/";
  EXPECT_EQ(below(deep + "x/1.png").path, folder / "x/1.png") << "by the end of its path";
  for (int i = 0; i < 10; ++i) deep += deep;
  EXPECT_TRUE(below(deep + "1.png").path.empty()) << "longer than any path";
}

TEST_F(ListedFile, OfTwoThatFitNoneIsTaken) {
  folder.touch("a.png");
  folder.touch("a.jpg");
  expect_file("a.jpg", "a.jpg", true);
  expect_error(Status::input, {"a.jpg", "a.png", "a.exr", folder.string()}, [&] { below("a.exr"); });
  expect_error(Status::input, {"a.jpg", "a.png"}, [&] { below("images/a"); });
  folder.touch("B.png");
  folder.touch("b.PNG");
  expect_error(Status::input, {"B.png", "b.PNG"}, [&] { below("b.png"); });
}

TEST_F(ListedFile, WhatIsWrittenComesFirstUnlessAFolderIsGiven) {
  const test::ViewFolder other;
  other.touch("1.png");
  folder.touch("1.png");
  const std::string absolute = (other / "1.png").string();
  EXPECT_EQ(beside(absolute).path, other / "1.png");
  EXPECT_EQ(below(absolute).path, folder / "1.png");
  EXPECT_EQ(below((other / "2.png").string()).path, "");
  other.touch("2.png");
  EXPECT_EQ(below((other / "2.png").string()).path, other / "2.png");
  // A file outside the folders is returned, for the error, only if no other matches.
  Roots roots;
  roots.add(folder.path());
  EXPECT_EQ(ListedFiles({folder.path()}, folder.path(), &roots).find(absolute).path, folder / "1.png");
  EXPECT_EQ(ListedFiles({folder.path()}, folder.path(), &roots).find((other / "2.png").string()).path, other / "2.png");
}

TEST_F(ListedFile, SaysWhereItLookedAndWhatIsNear) {
  folder.touch("deep/er/0001.png");
  folder.touch("0002.png");
  folder.touch("frame_0001.jpg");
  const std::string text = ListedFiles({folder.path()}).where_looked("images/0001.png");
  EXPECT_NE(text.find("looked for images/0001.png in " + folder.string()), std::string::npos) << text;
  EXPECT_NE(text.find("deep/er/0001.png"), std::string::npos) << text;
  EXPECT_NE(text.find("frame_0001.jpg"), std::string::npos) << text;
  EXPECT_EQ(text.find("0002.png"), std::string::npos) << "another number is another picture: " << text;
}

// Nothing but bytes tells "ä" from "a" and a combining diaeresis. A name in the other form is not taken, but named.
TEST_F(ListedFile, SaysWhichNameDiffersInItsUnicodeFormOnly) {
  struct Pair {
    const char *composed, *decomposed;
  };
  const Pair pairs[] = {{"k\u00e4se.png", "ka\u0308se.png"}, {"K\u00e4se/1.png", "Ka\u0308se/1.png"},
                        {"\u1ebf.png", "e\u0302\u0301.png"}, {"\u00ea\u0301.png", "e\u0302\u0301.png"},
                        {"\u30ac.png", "\u30ab\u3099.png"},  {"\ud55c.png", "\u1112\u1161\u11ab.png"}};
  for (const Pair& pair : pairs) {
    for (const auto& [listed, there] : {pair, Pair{pair.decomposed, pair.composed}}) {
      const test::ViewFolder own;
      own.touch(there);
      ListedFiles files({own.path()});
      EXPECT_TRUE(files.find(listed).path.empty()) << listed;
      const std::string advice = (own / there).string() + " is perhaps the same name in another Unicode form";
      for (const std::string& name : {std::string(listed), "set/" + std::string(listed)})
        EXPECT_NE(files.where_looked(name).find(advice), std::string::npos) << files.where_looked(name);
    }
  }
  folder.touch("ka\u0308se.png");
  for (const char* other : {"k\u00e4s.png", "kase.png", "kas\u00e9.png", "ko\u0308se.png", "k\u00e4se2.png"}) {
    const std::string text = ListedFiles({folder.path()}).where_looked(other);
    EXPECT_EQ(text.find("Unicode form"), std::string::npos) << text;
  }
}

}  // namespace
}  // namespace vsplat
