// The message of the Error that `work` throws, which must have the status; a failure of the test where it throws none.
#pragma once
#include <gtest/gtest.h>

#include <string>

#include "runtime/error.h"

namespace vsplat::test {

template <class Work>
std::string refusal(Work work, Status status) {
  try {
    work();
  } catch (const Error& e) {
    EXPECT_EQ(e.status(), status) << e.what();
    return e.what();
  }
  ADD_FAILURE() << "nothing was refused";
  return "";
}

}  // namespace vsplat::test
