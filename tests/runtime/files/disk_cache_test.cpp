#include "runtime/files/disk_cache.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "tests/support/temporary.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

class DiskCacheTest : public ::testing::Test {
 protected:
  test::TemporaryFolder home_;
  const fs::path folder_ = home_ / "cache";
  DiskCache cache_{folder_.string()};
  const std::vector<unsigned char> payload_ = {1, 2, 3, 250, 0, 7};
};

TEST_F(DiskCacheTest, GivesBackWhatWasStored) {
  EXPECT_FALSE(cache_.load("k"));
  cache_.store("k", payload_);
  ASSERT_TRUE(cache_.load("k"));
  EXPECT_EQ(*cache_.load("k"), payload_);
}

TEST_F(DiskCacheTest, DamagedEntriesAreNeverTrusted) {
  cache_.store("k", payload_);
  const fs::path entry = folder_ / "k.bin";
  std::string whole;
  {
    std::ifstream in(entry, std::ios::binary);
    whole.assign(std::istreambuf_iterator<char>(in), {});
  }
  for (std::size_t i = 0; i < whole.size(); ++i) {
    for (const bool cut : {true, false}) {
      std::string bad = cut ? whole.substr(0, i) : whole;
      if (!cut) bad[i] = static_cast<char>(bad[i] ^ 1);
      std::ofstream(entry, std::ios::binary) << bad;
      EXPECT_FALSE(cache_.load("k")) << (cut ? "cut at " : "flipped at ") << i;
      EXPECT_FALSE(fs::exists(entry)) << "a damaged entry stays";
    }
  }
}

TEST_F(DiskCacheTest, AnEntryOfAnotherKeyIsNone) {
  cache_.store("k", payload_);
  fs::copy_file(folder_ / "k.bin", folder_ / "other.bin");
  EXPECT_FALSE(cache_.load("other"));
  EXPECT_TRUE(cache_.load("k"));
}

TEST_F(DiskCacheTest, WhatIsNoFileIsNoEntry) {
  cache_.store("k", payload_);
  fs::create_directory(folder_ / "folder.bin");
  ASSERT_EQ(::mkfifo((folder_ / "pipe.bin").c_str(), 0600), 0);
  fs::create_symlink(folder_ / "k.bin", folder_ / "link.bin");
  for (const char* key : {"folder", "pipe", "link"}) {
    EXPECT_FALSE(cache_.load(key)) << key;
    cache_.store(key, payload_);
    EXPECT_EQ(cache_.load(key).has_value(), std::string(key) != "folder") << key;
  }
}

TEST_F(DiskCacheTest, AFolderThatOthersMayWriteToIsNotUsed) {
  cache_.store("k", payload_);
  EXPECT_EQ(fs::status(folder_).permissions(), fs::perms::owner_all);
  for (const fs::perms open : {fs::perms::group_write, fs::perms::others_write}) {
    fs::permissions(folder_, fs::perms::owner_all | open);
    const DiskCache shared(folder_.string());
    EXPECT_FALSE(shared.enabled());
    EXPECT_FALSE(shared.load("k"));
    shared.store("new", payload_);
    EXPECT_FALSE(fs::exists(folder_ / "new.bin"));
  }
  fs::permissions(folder_, fs::perms::owner_all);
  EXPECT_TRUE(DiskCache(folder_.string()).load("k"));
}

TEST_F(DiskCacheTest, KeysDependOnEveryPartAndItsBounds) {
  EXPECT_NE(DiskCache::key({"ab", "c"}), DiskCache::key({"a", "bc"}));
  EXPECT_NE(DiskCache::key({"ab"}), DiskCache::key({"ab", ""}));
  EXPECT_EQ(DiskCache::key({"ab", "c"}), DiskCache::key({"ab", "c"}));
}

TEST_F(DiskCacheTest, AFolderThatCannotBeMadeIsNoError) {
  std::ofstream(folder_.string() + "-file") << "x";
  const DiskCache blocked(folder_.string() + "-file/inside");
  blocked.store("k", payload_);
  EXPECT_FALSE(blocked.load("k"));
}

}  // namespace
}  // namespace vsplat
