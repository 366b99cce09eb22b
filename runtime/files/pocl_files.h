// PoCL's folder of compiled kernels, looked through for damaged files. PoCL loads what lies there as it is: of a file
// that is cut off or holds something else it crashes, in every run until the file is gone.
#pragma once
#include <string>
#include <vector>

namespace vsplat {

struct DamagedFile {
  std::string path;
  std::string what;  // "it is empty"
};

// Of the libraries (.so) and LLVM's bitcode (.bc) in that folder those that are not whole; by their structure, which
// tells of a file that is cut off, empty or something else, and not of single bytes. None where there is no folder.
std::vector<DamagedFile> damaged_files(const std::string& folder);

// Removes such files from PoCL's folder, once in a process, before the first kernel is compiled, with a warning that
// names them: PoCL compiles these kernels again. Error(device) where one cannot be removed.
void mend_pocl_files();

}  // namespace vsplat
