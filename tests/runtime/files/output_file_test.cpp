#include "runtime/files/output_file.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "runtime/error.h"
#include "tests/support/refusal.h"
#include "tests/support/temporary.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

// In a container each run may have the same process number.
TEST(OutputFile, WhatAKilledProcessOfThatNumberHasLeftIsNotInTheWay) {
  const test::TemporaryFolder folder;
  const std::string path = folder.path("t.json");
  std::string left;
  {
    const OutputFile file(path);
    left = fs::directory_iterator(folder.path(""))->path().string();
  }
  const std::size_t at = left.rfind('-') + 1;
  const unsigned long serial = std::stoul(left.substr(at));
  for (unsigned long next = serial + 1; next < serial + 4; ++next)
    std::ofstream(left.substr(0, at) + std::to_string(next) + ".tmp") << "left";
  OutputFile file(path);
  file.write("whole");
  file.commit();
  std::ifstream in(path);
  std::stringstream text;
  text << in.rdbuf();
  EXPECT_EQ(text.str(), "whole");
}

TEST(OutputFile, TellsWhatCannotBeCreated) {
  const test::TemporaryFolder folder;
  test::expect_error(Status::file, {"t.json: cannot be created as ", ".tmp: No such file"},
                     [&] { const OutputFile file(folder.path("none/t.json")); });
}

}  // namespace
}  // namespace vsplat
