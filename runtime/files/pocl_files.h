// Finds damaged files in PoCL's cache of compiled kernels. PoCL loads them unchecked: it crashes on a truncated or
// foreign file in every run until the file is gone. Also whether new files have space there.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

struct DamagedFile {
  std::string path;
  std::string what;  // "it is empty"
};

// The incomplete libraries (.so) and LLVM bitcode files (.bc) of programs, which have folders of their own below the
// given one. The check is by structure: it finds files that are truncated, empty or something else, but no single wrong
// bytes. Empty if there is no folder.
std::vector<DamagedFile> damaged_files(const std::string& folder);

// Removes such files from PoCL's cache, once in a process, before the first kernel is compiled, with a warning that
// names them; PoCL then compiles these kernels again. Error(device) if a file cannot be removed.
void mend_pocl_files();

// Error(file) if PoCL's folder has no space for a compiled kernel: PoCL would call that a failed compilation, or end
// the process.
void need_space_for_pocl();

}  // namespace vsplat
