// Wrong kernels, to see that they are found.
#pragma once
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "runtime/kernel_files.h"
#include "runtime/program.h"
#include "tests/support/temporary.h"
#include "tests/support/variable.h"

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

struct Mistake {
  const char *file, *right, *wrong;
};

// Plants one mistake after another; `wrong` must say each time what is wrong.
inline void expect_found(const std::vector<Mistake>& mistakes, const std::function<std::string()>& wrong) {
  for (const Mistake& mistake : mistakes) {
    const TemporaryFolder folder;
    ASSERT_TRUE(plant(folder.path(), mistake.file, mistake.right, mistake.wrong)) << mistake.right;
    const Variable kernels("VSPLAT_KERNEL_DIR", folder.string().c_str());
    EXPECT_NE(wrong(), "") << mistake.wrong;
  }
}

}  // namespace vsplat::test
