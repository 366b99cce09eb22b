// Throwing an Error with a formatted message. For sources: a header that only names Error takes error.h.
#pragma once
#include <fmt/core.h>

#include "runtime/error.h"

namespace vsplat {

// Out of line, so that what formats is compiled once.
[[noreturn]] void throw_formatted(Status status, fmt::string_view text, fmt::format_args args);

// fail(Status::format, "{}: {} values, {} expected", path, found, expected). The text is checked when it is compiled.
template <class... Args>
[[noreturn]] void fail(Status status, fmt::format_string<Args...> text, Args&&... args) {
  throw_formatted(status, text, fmt::make_format_args(args...));
}

}  // namespace vsplat
