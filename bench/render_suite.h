// The case that a fitting step is compared with.
#pragma once
#include <string>

#include "bench/bench.h"

namespace vsplat::bench {

// A scene drawn and differentiated, by its cameras in turn; `folder`: as Options::scenes.
Prepared prepare_backward(Context& ctx, const std::string& name, const std::string& folder);

}  // namespace vsplat::bench
