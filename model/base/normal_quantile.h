// The inverse of the normal distribution function, from + - * / and sqrt alone, which IEEE 754 defines to the bit:
// unlike std::log or std::erfc it gives the same value on every machine and with every C library.
#pragma once

namespace vsplat {

// p in (0,1) -> z with Phi(z) = p, to a relative 1e-15.
double normal_quantile(double p);

}  // namespace vsplat
