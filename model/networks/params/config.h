// VS-Splat's configurations: by name, checked, and as the JSON in every model file.
#pragma once
#include <string>
#include <vector>

#include "model/networks/params/config_fields.h"
#include "runtime/error.h"

namespace vsplat {

// paper, small (what two CPU cores train), tiny and micro (for tests), in this order.
const std::vector<std::string>& config_names();
Config named_config(const std::string& name);  // Error(usage) that lists the names

// Refuses a configuration that cannot be built. The error names the field and its value.
void check(const Config& config, Status status = Status::usage);

// Parses "fine_count=1", "volume_mult=1,2" or "use_projected=false" by the field's type; does not check it against
// other fields.
void set_field(Config& config, const std::string& assignment);
// Sets all of them, then calls check().
Config with_fields(Config config, const std::vector<std::string>& assignments);

// All fields, in the order above.
std::string to_json(const Config& config);
// Absent fields come from `base`. Error(format) names unknown fields and wrong types. The result is checked.
Config config_from_json(const std::string& text, const Config& base = {});

// Sets the fields that `text` has in `config`, which is not checked. Returns their names. Errors as above.
std::vector<std::string> set_fields_from_json(Config& config, const std::string& text);

// A field's value as JSON.
std::string field_text(const Config& config, const std::string& field);
// Those of `fields` that differ between two configurations.
std::vector<std::string> differing_fields(const Config& a, const Config& b, const std::vector<std::string>& fields);

}  // namespace vsplat
