// Explains in messages why no device can be used, as far as that is visible without loading the drivers.
#pragma once
#include <string>

namespace vsplat {

// If no device was found: a sentence about what was found instead, and what to do.
std::string why_no_device();

// If devices were found, but not the requested one: what prevents a driver from offering its devices. "" if nothing
// does.
std::string unusable_drivers();

}  // namespace vsplat
