// Replays the fuzzers' seeds and every input that once broke a reader, in every build.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <ostream>

#include "tests/fuzz/targets.h"
#include "tests/support/temporary.h"

namespace vsplat::fuzz {
namespace {

struct Target {
  const char* name;
  void (*run)(std::string_view);
};

void PrintTo(const Target& target, std::ostream* out) { *out << target.name; }

class Replay : public ::testing::TestWithParam<Target> {
 protected:
  static std::vector<std::string> files(const char* kind) {
    std::vector<std::string> out;
    const std::filesystem::path folder = std::filesystem::path(VSPLAT_FUZZ_DATA) / kind / GetParam().name;
    if (std::filesystem::is_directory(folder))
      for (const auto& entry : std::filesystem::directory_iterator(folder)) out.push_back(entry.path().string());
    std::sort(out.begin(), out.end());
    return out;
  }
};

TEST_P(Replay, Corpus) {
  ASSERT_GE(files("corpus").size(), 2u);
  for (const std::string& path : files("corpus")) {
    SCOPED_TRACE(path);
    EXPECT_NO_THROW(GetParam().run(test::contents_of(path)));
  }
}

TEST_P(Replay, WhatOnceBroke) {
  for (const std::string& path : files("regressions")) {
    SCOPED_TRACE(path);
    EXPECT_NO_THROW(GetParam().run(test::contents_of(path)));
  }
}

// Truncates inputs and changes bytes, as a fuzzer would.
TEST_P(Replay, DamagedCorpus) {
  for (const std::string& path : files("corpus")) {
    SCOPED_TRACE(path);
    const std::string good = test::contents_of(path);
    for (std::size_t i = 0; i < good.size(); i += 1 + good.size() / 100) {
      EXPECT_NO_THROW(GetParam().run(good.substr(0, i)));
      std::string bad = good;
      bad[i] = static_cast<char>(bad[i] ^ (1 << i % 8));
      EXPECT_NO_THROW(GetParam().run(bad)) << "byte " << i;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Fuzz, Replay,
                         ::testing::Values(Target{"checkpoint", checkpoint}, Target{"colmap", colmap},
                                           Target{"colmap_points", colmap_points},
                                           Target{"fit_checkpoint", fit_checkpoint}, Target{"gltf_splats", gltf_splats},
                                           Target{"kernel_cache", kernel_cache}, Target{"model", model},
                                           Target{"pickle", pickle}, Target{"picture_bmp", picture_bmp},
                                           Target{"picture_exr", picture_exr}, Target{"picture_jpeg", picture_jpeg},
                                           Target{"picture_png", picture_png}, Target{"picture_tiff", picture_tiff},
                                           Target{"picture_webp", picture_webp}, Target{"ply", ply},
                                           Target{"reader", reader}, Target{"selection", selection}, Target{"sog", sog},
                                           Target{"sog_meta", sog_meta}, Target{"splat", splat}, Target{"spz", spz},
                                           Target{"torch_file", torch_file}, Target{"train_config", train_config},
                                           Target{"views_json", views_json}),
                         [](const auto& target) { return std::string(target.param.name); });

}  // namespace
}  // namespace vsplat::fuzz
