#include "runtime/option.h"

#include <gtest/gtest.h>

#include "runtime/error.h"
#include "runtime/fail.h"

namespace vsplat {
namespace {

std::string message() {
  try {
    fail(Status::memory, "{} GiB may be used ({}, {})", 3, Option::max_memory, Option::tune_table);
  } catch (const Error& e) {
    return e.what();
  }
}

TEST(Option, MessagesSpellItAsTheProcessHasSet) {
  EXPECT_EQ(message(), "3 GiB may be used (max_memory, tune_table)");
  OptionNames names;
  names[static_cast<std::size_t>(Option::max_memory)] = "--max-memory";
  set_option_names(names);
  EXPECT_EQ(message(), "3 GiB may be used (--max-memory, tune_table)");
  set_option_names({});
  EXPECT_EQ(message(), "3 GiB may be used (max_memory, tune_table)");
}

}  // namespace
}  // namespace vsplat
