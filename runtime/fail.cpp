#include "runtime/fail.h"

#include <fmt/format.h>

namespace vsplat {

void throw_formatted(Status status, fmt::string_view text, fmt::format_args args) {
  throw Error(status, fmt::vformat(text, args));
}

}  // namespace vsplat
