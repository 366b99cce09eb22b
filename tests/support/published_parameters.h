// Compares with the parameters that a network's specification lists at the published size. `*_reference.py NETWORK
// published` prints lines like "net.view_embed    1 x 4 x 32 x 1 x 1 x 1    parameter" (or "buffer", which is in no
// model file), and at the end the number of values. Expects more than `least` parameters and exactly `values` values.
#pragma once
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "model/networks/params/parameter.h"
#include "tests/support/golden.h"
#include "tests/support/temporary.h"

namespace vsplat::test {

inline std::string line_of(const Parameter& p) { return fmt::format("net.{} {}", p.name, fmt::join(p.shape, " x ")); }

inline void expect_published(const std::string& file, const std::vector<Parameter>& parameters, std::size_t least,
                             const std::string& values) {
  const std::filesystem::path folder = std::filesystem::path(Golden::path_of("micro")).parent_path();
  std::istringstream lines(contents_of((folder / file).string()));
  std::vector<std::string> want, got;
  std::string line, count;
  while (std::getline(lines, line)) {
    std::istringstream words(line);
    std::string word, text;
    words >> text;
    count = text;
    while (words >> word && word != "parameter" && word != "buffer") text += " " + word;
    if (word == "parameter") want.push_back(text);
  }
  for (const Parameter& p : parameters) got.push_back(line_of(p));
  EXPECT_GT(want.size(), least);
  EXPECT_EQ(got, want);
  EXPECT_EQ(count, values);
}

}  // namespace vsplat::test
