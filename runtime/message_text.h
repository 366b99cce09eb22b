// The text of a message. Numbers that are not finite have names in it: NaN, infinity and -infinity.
#pragma once
#include <fmt/core.h>

#include <string>

namespace vsplat {

std::string message_text(fmt::string_view text, fmt::format_args args);

// One number, as message_text() shows it.
std::string number_text(double value);
std::string number_text(float value);

}  // namespace vsplat
