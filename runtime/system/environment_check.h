// Finds environment variables with invalid values. To ignore them would be a silent fallback.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

struct VariableProblem {
  std::string name;
  std::string found;  // a sentence that begins with the name
  std::string mend;
};

// Checks the variables that this library reads. Values that need a device (VSPLAT_DEVICE), and files, are checked where
// they are used.
std::vector<VariableProblem> environment_problems();
// Unsets an empty POCL_CACHE_DIR, which would end the process in PoCL. vsplat's own variables count as unset, too, if
// they are empty.
void unset_empty_variables();
// Unsets empty variables. Error(usage) with the first problem.
void check_environment();

}  // namespace vsplat
