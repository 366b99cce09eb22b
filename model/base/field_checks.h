// Checks of configuration fields. An error states the requirement and the value found, with the given status.
#pragma once
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "model/base/json_fields.h"
#include "runtime/fail.h"

namespace vsplat {

class FieldChecks {
 public:
  explicit FieldChecks(Status status) : status_(status) {}

  template <class Value>
  void need(bool ok, const std::string& text, const Value& found) const {
    if (!ok) fail(status_, "{} (found {})", text, found);
  }

  void at_most(const char* name, int value, int most) const {
    need(value <= most, fmt::format("{} must be at most {}", name, most), value);
  }

  void within(const char* name, long value, long least, long most) const {
    need(value >= least && value <= most, fmt::format("{} must be {} to {}", name, least, most), value);
  }

  // NaN fails for every range.
  void in(const char* name, double value, bool ok, const char* range) const {
    need(std::isfinite(value) && ok, fmt::format("{} must be {}", name, range), value);
  }

  void one_of(const char* name, const std::string& value, const std::vector<std::string>& allowed) const {
    need(std::find(allowed.begin(), allowed.end(), value) != allowed.end(),
         fmt::format("{} must be one of {}", name, fmt::join(allowed, ", ")), json_fields::shown(value));
  }

  // Kernels use 32-bit indices, which limits the number of elements of a tensor.
  void indexable(const char* what, double elements) const {
    need(elements <= 2147483647.0, fmt::format("{} must be at most 2147483647", what), fmt::format("{:.0f}", elements));
  }

 private:
  Status status_;
};

}  // namespace vsplat
