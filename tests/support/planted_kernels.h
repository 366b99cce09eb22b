// Wrong kernels, to see that they are found.
#pragma once
#include <filesystem>
#include <fstream>
#include <string>

#include "runtime/kernel_files.h"
#include "runtime/program.h"

namespace vsplat::test {

// Writes the kernels into a folder, with the first place of one text replaced in one file. False if it is not there.
inline bool plant(const std::filesystem::path& folder, const std::string& file, const std::string& right,
                  const std::string& wrong) {
  bool made = false;
  for (const std::string& name : kernel_file_names()) {
    std::string text = kernel_text(name);
    if (const std::size_t at = text.find(right); name == file && at != std::string::npos)
      text.replace(at, right.size(), wrong), made = true;
    std::ofstream(folder / name) << text;
  }
  return made;
}

}  // namespace vsplat::test
