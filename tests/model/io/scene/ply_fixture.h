// For tests of PLY files: a file in a temporary folder, and what reading it says.
#pragma once
#include <gtest/gtest.h>

#include <cstring>
#include <fstream>
#include <random>

#include "model/io/scene/ply.h"
#include "runtime/error.h"
#include "runtime/files/file.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat::test {

inline std::string floats(const std::vector<float>& values) {
  std::string out(values.size() * 4, '\0');
  std::memcpy(out.data(), values.data(), out.size());
  return out;
}

class PlyFixture : public ::testing::Test {
 protected:
  std::string path(const std::string& name = "scene.ply") const { return folder_ / name; }
  void put(const std::string& bytes) const { std::ofstream(path(), std::ios::binary) << bytes; }
  std::string bytes() const {
    const auto data = read_file(path());
    return {data.begin(), data.end()};
  }
  // The error message for these bytes, with the expected status; "" if there is none.
  std::string complaint(const std::string& content, Status status = Status::format) const {
    put(content);
    try {
      read_ply(path());
    } catch (const Error& e) {
      EXPECT_EQ(e.status(), status) << e.what();
      EXPECT_NE(std::string(e.what()).find(path()), std::string::npos) << e.what();
      return e.what();
    }
    return "";
  }
  // Cut off anywhere, or with any byte changed: an error or a scene, never a crash.
  void expect_survives_damage(const Gaussians& gaussians) const {
    Scene scene;
    scene.gaussians = gaussians;
    write_ply(path(), scene);
    const std::string good = bytes();
    for (std::size_t n = 0; n < good.size(); n += n < 900 ? 5 : 97)
      EXPECT_NE(complaint(good.substr(0, n)), "") << n << " bytes";
    std::mt19937 engine(5);
    for (int i = 0; i < 400; ++i) {
      std::string bad = good;
      const std::size_t at = engine() % (i % 2 ? 800 : bad.size());
      bad[at] = static_cast<char>(bad[at] ^ (1 << engine() % 8));
      complaint(bad);
    }
  }

  TemporaryFolder folder_;
  Warnings warnings_;
};

}  // namespace vsplat::test
