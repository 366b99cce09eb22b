// Files and folders that other processes may use, too: replacing, locking, reading.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <functional>

#include "runtime/error.h"
#include "runtime/files/file.h"
#include "runtime/files/file_rules.h"
#include "runtime/files/folder_lock.h"
#include "runtime/files/roots.h"
#include "runtime/files/staged_folder.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;
using test::contents_of;
using test::expect_error;
using test::put_file;
using test::TemporaryFolder;

class Rules {
 public:
  explicit Rules(FileRules rules) { set_file_rules(std::move(rules)); }
  ~Rules() { set_file_rules({}); }
};

void put(const std::string& path) { write_file(path, "new", 3); }

TEST(FileRules, KeepWhatIsThereAndTellWhatIsMade) {
  const TemporaryFolder folder;
  std::vector<std::string> made;
  const Rules rules({[&](const std::string& path) { return path != folder / "kept"; },
                     [&](const std::string& path, bool created) {
                       if (created) made.push_back(path);
                     }});
  put_file(folder / "kept", "old");
  put_file(folder / "replaced", "old");
  expect_error(Status::file, {folder / "kept", "exists"}, [&] { put(folder / "kept"); });
  put(folder / "replaced");
  put(folder / "created");
  EXPECT_EQ(contents_of(folder / "kept"), "old");
  EXPECT_EQ(contents_of(folder / "replaced"), "new");
  EXPECT_EQ(made, std::vector<std::string>{folder / "created"});
  EXPECT_EQ(folder.entries(), (std::vector<std::string>{"created", "kept", "replaced"}));
}

TEST(OpenRegular, TakesNothingElse) {
  const TemporaryFolder folder;
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  expect_error(Status::file, {folder / "pipe", "no regular file"}, [&] { read_file(folder / "pipe"); });
  expect_error(Status::file, {"/dev/zero", "no regular file"}, [&] { read_file("/dev/zero"); });
  expect_error(Status::file, {folder.string(), "is a folder"}, [&] { read_file(folder.string()); });
  expect_error(Status::file, {folder / "none"}, [&] { read_file(folder / "none"); });
}

TEST(FolderLock, IsHeldByOneAndTakesAwayWhatItMadeAndLeftEmpty) {
  const TemporaryFolder folder;
  {
    const FolderLock lock(folder / "a/b");
    EXPECT_TRUE(fs::is_directory(folder / "a/b"));
    expect_error(Status::file, {folder / "a/b", "another process"}, [&] { FolderLock(folder / "a/b"); });
    const FolderLock other(folder / "a");
  }
  EXPECT_TRUE(folder.entries().empty());
  {
    const FolderLock lock(folder / "a/b");
    put_file(folder / "a/file", "");
  }
  EXPECT_TRUE(fs::exists(folder / "a/file"));
  EXPECT_FALSE(fs::exists(folder / "a/b"));
  put_file(folder / "file", "");
  expect_error(Status::file, {folder / "file/b", "cannot be made"}, [&] { FolderLock(folder / "file/b"); });
}

TEST(StagedFolder, AppearsWholeAndKeepsWhatIsNotOurs) {
  const TemporaryFolder folder;
  const auto ours = [](const std::string& inside) { return inside == "ours" || inside == "in/ours"; };
  { StagedFolder gone(folder / "set/a"); }
  EXPECT_TRUE(folder.entries().empty());
  for (const std::string content : {"first", "second"}) {
    StagedFolder staged(folder / "set/a");
    expect_error(Status::file, {folder / "set/a", "another process"}, [&] { StagedFolder(folder / "set/a"); });
    put_file(staged.path() / "ours", content);
    EXPECT_EQ(fs::exists(folder / "set/a/ours"), content == "second");
    staged.put_in_place(ours);
    EXPECT_EQ(contents_of(folder / "set/a/ours"), content);
    fs::create_directories(folder / "set/a/in/deep");
    for (const char* name : {"mine", "in/mine", "in/deep/mine", "in/ours"})
      put_file(folder / ("set/a/" + std::string(name)), "");
  }
  EXPECT_TRUE(fs::exists(folder / "set/a/in/deep/mine"));
  {
    StagedFolder staged(folder / "set/a");
    put_file(staged.path() / "ours", "third");
    staged.put_in_place(ours);
  }
  for (const char* name : {"mine", "in/mine", "in/deep/mine"})
    EXPECT_TRUE(fs::exists(folder / ("set/a/" + std::string(name))));
  EXPECT_FALSE(fs::exists(folder / "set/a/in/ours"));
  const Rules keep({[](const std::string&) { return false; }, {}});
  StagedFolder staged(folder / "set/a");
  put_file(staged.path() / "ours", "fourth");
  expect_error(Status::file, {folder / "set/a/ours", "exists"}, [&] { staged.put_in_place(ours); });
  EXPECT_EQ(contents_of(folder / "set/a/ours"), "third");
}

TEST(Roots, HoldWhatLiesInThemLinksFollowed) {
  const TemporaryFolder folder;
  fs::create_directories(folder / "root/in");
  fs::create_directories(folder / "rooted");
  for (const char* name : {"root/a", "root/in/a", "rooted/a", "a"}) put_file(folder / name, "");
  fs::create_symlink("../a", folder / "root/out");
  fs::create_symlink("in/a", folder / "root/link");
  fs::create_symlink(folder / "rooted", folder / "root/folder");
  Roots roots;
  roots.add(folder / "root");
  for (const char* name : {"root/a", "root/in/a", "root/link", "root/in/../a", "root/none"})
    EXPECT_TRUE(roots.hold(folder / name)) << name;
  for (const char* name : {"a", "rooted/a", "root/out", "root/folder/a", "root/../a", "root/none/../../a"}) {
    EXPECT_FALSE(roots.hold(folder / name)) << name;
    expect_error(Status::file, {"it", folder / name, folder / "root", "allow_outside"},
                 [&] { roots.need(folder / name, "it"); });
  }
  const Rules anywhere({{}, {}, true});
  EXPECT_TRUE(roots.hold(folder / "a"));
}

}  // namespace
}  // namespace vsplat
