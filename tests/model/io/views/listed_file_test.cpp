#include "model/io/views/listed_file.h"

#include "tests/support/posed_views.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
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
  // Only with its exact name: folders outside are not listed.
  other.touch("a\xcc\x88.png");
  const std::string composed = (other / "\xc3\xa4.png").string();
  EXPECT_EQ(ListedFiles({folder.path()}, folder.path()).find(composed).path, other / "a\xcc\x88.png");
  EXPECT_EQ(ListedFiles({folder.path()}, folder.path(), &roots).find(composed).path, "");
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

// A name in two Unicode forms. Only bytes tell "ä" from "a" and a combining diaeresis.
struct Forms {
  const char *composed, *decomposed;
};
constexpr Forms kForms[] = {{"k\u00e4se.png", "ka\u0308se.png"},
                            {"K\u00e4se/1.png", "Ka\u0308se/1.png"},
                            {"\u1ebf.png", "e\u0302\u0301.png"},
                            {"\u30ac.png", "\u30ab\u3099.png"},
                            {"\ud55c/\u00e9.png", "\u1112\u1161\u11ab/e\u0301.png"}};

TEST_F(ListedFile, InEitherUnicodeForm) {
  for (const Forms& forms : kForms)
    for (const auto& [listed, there] : {forms, Forms{forms.decomposed, forms.composed}}) {
      const test::ViewFolder own;
      own.touch(there);
      own.touch("other.png");
      for (const std::string& name : {std::string(listed), "set/" + std::string(listed), "/a/" + std::string(listed)})
        for (const FoundFile& found :
             {ListedFiles({own.path()}).find(name), ListedFiles({own.path()}, own.path()).find(name)}) {
          EXPECT_EQ(found.path, own / there) << name;
          EXPECT_FALSE(found.exactly) << name;
        }
      EXPECT_EQ(ListedFiles({}, "/somewhere").find((own / listed).string()).path, own / there) << "an absolute path";
      EXPECT_EQ(ListedFiles({own.path()}).find_with_ending(listed), own / there);
      EXPECT_EQ(ListedFiles({own.path()}).find(fs::path(listed).replace_extension(".jpg").string()).path, own / there);
      own.touch(listed);
      const FoundFile exact = ListedFiles({own.path()}).find(listed);
      EXPECT_EQ(exact.path, own / listed) << "the listed form comes first";
      EXPECT_TRUE(exact.exactly);
    }
}

TEST_F(ListedFile, InEitherUnicodeFormAndCase) {
  folder.touch("A\u0308PFEL.JPG");
  expect_file("\u00e4pfel.jpg", "A\u0308PFEL.JPG", false);
  expect_file("\u00c4pfel.png", "A\u0308PFEL.JPG", false);
  for (const char* other : {"apfel.jpg", "\u00e1pfel.jpg", "\u00e4pfe.jpg", "\xe4pfel.jpg"})
    EXPECT_TRUE(below(other).path.empty()) << other;
  folder.touch("\xe4.png");  // not UTF-8
  expect_file("\xe4.PNG", "\xe4.png", false);
  EXPECT_TRUE(below("\u00e4.png").path.empty());
}

TEST_F(ListedFile, TheListedUnicodeFormComesBeforeShorterTails) {
  folder.touch("cam/e\u0301.png");
  folder.touch("\u00e9.png");
  expect_file("cam/\u00e9.png", "cam/e\u0301.png", false);
}

// Both folders exist, as after copying from two systems into one. Each file is found in the one that has it.
TEST_F(ListedFile, InTwoFoldersOfOneName) {
  folder.touch("\u00e9/1.png");
  folder.touch("e\u0301/2.png");
  expect_file("\u00e9/1.png", "\u00e9/1.png", true);
  expect_file("\u00e9/2.png", "e\u0301/2.png", false);
  expect_file("e\u0301/1.png", "\u00e9/1.png", false);
}

TEST_F(ListedFile, OfTwoUnicodeFormsNoneIsTaken) {
  const char *composed = "\u1ebf.png", *decomposed = "e\u0302\u0301.png";
  folder.touch(composed);
  folder.touch(decomposed);
  for (const char* other : {"\u00ea\u0301.png", "\u1ebe.PNG", "set/\u1ebf.jpg"})
    expect_error(Status::input, {folder.string(), composed, decomposed, "differ in their Unicode form only"},
                 [&] { below(other); });
  expect_file(composed, composed, true);
}

}  // namespace
}  // namespace vsplat
