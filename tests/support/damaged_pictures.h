// Truncated pictures, and pictures with flipped bits, which every picture reader must survive.
#pragma once
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "model/io/picture/image_file.h"
#include "runtime/error.h"
#include "runtime/files/file.h"

namespace vsplat::test {

// A picture cut short anywhere is an error that names it, and libraries print nothing.
inline void expect_truncations_are_errors(const std::vector<std::string>& paths) {
  testing::internal::CaptureStderr();
  for (const std::string& path : paths) {
    const std::vector<unsigned char> bytes = read_file(path);
    const std::string cut = path + ".cut";
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      const std::vector<unsigned char> part(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
      try {
        decode_image({cut, part.data(), part.size()});
        ADD_FAILURE() << path << " cut to " << size << " of " << bytes.size() << " bytes was read";
      } catch (const Error& e) {
        ASSERT_EQ(e.status(), Status::format) << e.what();
        ASSERT_NE(std::string(e.what()).find(cut), std::string::npos) << e.what();
      }
    }
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

// With a few bits flipped, reading gives an error that names the file, or a picture of its size with values from 0 to
// 1. Half of the flips are in the first `header` bytes, where they do most harm; `skip` identifies valid but slow
// inputs.
template <class Skip>
void expect_flips_are_survived(const std::vector<std::string>& paths, unsigned seed, std::size_t header,
                               const Skip& skip) {
  testing::internal::CaptureStderr();
  std::mt19937 rng(seed);
  for (const std::string& path : paths) {
    const std::vector<unsigned char> bytes = read_file(path);
    const std::string flipped = path + ".flipped";
    for (int trial = 0; trial < 300; ++trial) {
      std::vector<unsigned char> damaged = bytes;
      const std::size_t range = trial % 2 ? bytes.size() : std::min<std::size_t>(bytes.size(), header);
      for (int k = 0; k <= trial % 3; ++k) damaged[rng() % range] ^= static_cast<unsigned char>(1u << rng() % 8);
      const FileBytes file{flipped, damaged.data(), damaged.size()};
      try {
        if (skip(file)) continue;
        const Image image = decode_image(file);
        ASSERT_EQ(image.data.size(), static_cast<std::size_t>(image.width) * image.height * image.channels);
        for (const float v : image.data) ASSERT_TRUE(v >= 0 && v <= 1) << path << " trial " << trial;
      } catch (const Error& e) {
        ASSERT_NE(std::string(e.what()).find(flipped), std::string::npos) << e.what();
      }
    }
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace vsplat::test
