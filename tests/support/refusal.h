// Helpers for expected errors and recorded warnings.
#pragma once
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "runtime/error.h"
#include "runtime/log.h"

namespace vsplat::test {

// The message of the Error that `work` throws, which must have the status; a test failure if it throws none.
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

// As above; the message must contain each of `words`.
template <class Work>
void expect_error(Status status, const std::vector<std::string>& words, Work&& work) {
  const std::string text = refusal(work, status);
  for (const std::string& word : words)
    EXPECT_NE(text.find(word), std::string::npos) << "\"" << word << "\" is not in: " << text;
}

// Collects warnings during its lifetime.
class Warnings {
 public:
  Warnings() {
    set_log_sink([this](LogLevel level, const std::string& text) {
      if (level == LogLevel::warning) all.push_back(text);
    });
  }
  ~Warnings() { set_log_sink({}); }
  Warnings(const Warnings&) = delete;
  Warnings& operator=(const Warnings&) = delete;

  std::string text() const {  // one a line
    std::string out;
    for (const std::string& warning : all) out += warning + "\n";
    return out;
  }

  std::vector<std::string> all;
};

}  // namespace vsplat::test
