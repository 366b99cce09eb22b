#include "runtime/fail.h"

#include "runtime/message_text.h"

namespace vsplat {

void throw_formatted(Status status, fmt::string_view text, fmt::format_args args) {
  throw Error(status, message_text(text, args));
}

}  // namespace vsplat
