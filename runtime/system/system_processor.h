// Instructions of the processor that this process runs on.
#pragma once

namespace vsplat {

bool has_avx512bf16();

// Whether the processor has AMX with bf16, and the system lets this process use it, for which this asks: Linux keeps
// its registers only then.
bool may_use_amx();

}  // namespace vsplat
