// Throws an Error with a formatted message. For source files: a header that only names Error includes error.h.
#pragma once
#include <fmt/core.h>

#include "runtime/error.h"

namespace vsplat {

// Not inline, so that the formatting code is compiled once.
[[noreturn]] void throw_formatted(Status status, fmt::string_view text, fmt::format_args args);

// fail(Status::format, "{}: {} values, {} expected", path, found, expected). The text is checked when it is compiled.
template <class... Args>
[[noreturn]] void fail(Status status, fmt::format_string<Args...> text, Args&&... args) {
  throw_formatted(status, text, fmt::make_format_args(args...));
}

}  // namespace vsplat
