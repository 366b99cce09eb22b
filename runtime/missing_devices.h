// Explains in messages why no device can be used, as far as this shows from outside of the drivers.
#pragma once
#include <string>

namespace vsplat {

// For the case that no device was found: a sentence about what there is instead, and what to do.
std::string why_no_device();

// For the case that devices were found, but not the requested one: what keeps a driver from offering its devices. "" if
// nothing does.
std::string unusable_drivers();

}  // namespace vsplat
