// What a checkpoint records about the way its numbers were computed, so that a resumed run computes the same ones: the
// hash of the table of tuned parameters, the precision, and what a self-test has switched off.
#pragma once
#include <map>
#include <string>

#include "runtime/context.h"

namespace vsplat {

// Describes what is switched off and changes sums; choices of tables are covered by the table's hash.
std::string switched_off_of(const Context& ctx);

// Writes "tuning" (empty: none), "precision" and, if anything is, "switched_off".
void hold_tuning(const Context& ctx, std::map<std::string, std::string>& state);
// Error(usage), naming both values, if the checkpoint was made with another table or precision than the context's;
// `path` is the checkpoint. A checkpoint from before tables existed counts as without a table and fp32. Only warns if
// something else is switched off now: a run should not continue with what was found wrong.
void refuse_other_tuning(const Context& ctx, const std::map<std::string, std::string>& state, const std::string& path);

}  // namespace vsplat
