// The facts about the system that a defect report contains.
#pragma once
#include <nlohmann/json.hpp>

namespace vsplat {

// {"kernel", "machine", "system", "libc", "processor", "processors": their number, "memory": bytes}.
nlohmann::ordered_json system_facts();
// The environment variables that affect OpenCL, its drivers and this library, by name: those of a fixed list, and no
// others.
nlohmann::ordered_json environment_facts();
// The JSON files that this library has put into the cache folder: verdicts/, tuning/, measured peaks; no compiled
// kernels and no other files. A list of {"file", "content"}; for a large or damaged file {"file", "bytes"}.
nlohmann::ordered_json stored_facts();

}  // namespace vsplat
