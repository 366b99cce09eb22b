// Why no device can be used, as far as can be seen from outside the drivers: for messages.
#pragma once
#include <string>

namespace vsplat {

// Where no device was found: a sentence about what there is instead, and what to do.
std::string why_no_device();

// Where devices were found, and another was asked for: what keeps a driver from giving its own. "" where nothing does.
std::string unusable_drivers();

}  // namespace vsplat
