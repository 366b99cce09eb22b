// The inverse normal distribution function, computed only with + - * / and sqrt, whose results IEEE 754 defines
// exactly. Unlike std::log or std::erfc, it gives the same value on every machine and with every C library.
#pragma once

namespace vsplat {

// Returns z with Phi(z) = p for p in (0,1), with a relative error of 1e-15.
double normal_quantile(double p);

}  // namespace vsplat
