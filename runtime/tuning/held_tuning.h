// What a checkpoint holds of how its numbers were made, so that what goes on from it makes the same ones: the table of
// tuned parameters, by its hash, the precision, and what a self-test has switched off.
#pragma once
#include <map>
#include <string>

#include "runtime/context.h"

namespace vsplat {

// What is switched off and changes sums, in words: of what tables choose their hash tells.
std::string switched_off_of(const Context& ctx);

// As "tuning" (empty: none), "precision" and, where something is, "switched_off".
void hold_tuning(const Context& ctx, std::map<std::string, std::string>& state);
// Error(usage) naming both where a checkpoint was made with another table, or precision, than the context has; `path`
// is whose state it is. What was made before there were tables had none, and fp32. A warning where something else is
// switched off now: what was found wrong is no reason to go on with it.
void refuse_other_tuning(const Context& ctx, const std::map<std::string, std::string>& state, const std::string& path);

}  // namespace vsplat
