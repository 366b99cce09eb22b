// What a report of a defect tells of the system that it happened on.
#pragma once
#include <nlohmann/json.hpp>

namespace vsplat {

// {"kernel", "machine", "system", "libc", "processor", "processors": their number, "memory": bytes}.
nlohmann::ordered_json system_facts();
// The variables that OpenCL, its drivers and this library go by, by name: those of a list, and no other.
nlohmann::ordered_json environment_facts();
// What this library has put into the cache's folder in JSON: verdicts/, tuning/, measured peaks; not compiled kernels,
// nor what else lies there. A list of {"file", "content"}; of one that is large or damaged {"file", "bytes"}.
nlohmann::ordered_json kept_facts();

}  // namespace vsplat
