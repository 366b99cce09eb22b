// Committed files of tests/golden.
#pragma once
#include <string>

namespace vsplat::test {

// The path of a file or folder there.
std::string golden_file(const std::string& name);

}  // namespace vsplat::test
