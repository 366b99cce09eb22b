// Text of unknown origin, for a message.
#pragma once
#include <string>
#include <string_view>

namespace vsplat {

// At most 100 bytes of it; control characters and what is no UTF-8 become ?.
std::string printable(std::string_view text);

}  // namespace vsplat
