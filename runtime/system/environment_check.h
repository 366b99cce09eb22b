// Variables of the environment that say something which is not understood. Taken for nothing they would be a silent
// fallback.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

struct VariableProblem {
  std::string name;
  std::string found;  // a sentence that begins with the name
  std::string mend;
};

// Of those that this library reads. Values that need a device (VSPLAT_DEVICE), and files, are looked at where they are
// used.
std::vector<VariableProblem> environment_problems();
// Error(usage) with the first of them.
void check_environment();

}  // namespace vsplat
