// Configurations: by name, checked, and as the JSON that every model file holds.
#pragma once
#include <string>
#include <vector>

#include "model/networks/params/config_fields.h"
#include "runtime/error.h"

namespace vsplat {

// paper, small (what two CPU cores train), tiny and micro (for tests), in this order.
const std::vector<std::string>& config_names();
Config named_config(const std::string& name);  // Error(usage) that lists the names

// Refuses by name, with the value found, what cannot be built.
void check(const Config& config, Status status = Status::usage);

// "fine_count=1", "volume_mult=1,2", "use_projected=false": parsed by the field's type; not checked against other
// fields.
void set_field(Config& config, const std::string& assignment);
// All of them, then check().
Config with_fields(Config config, const std::vector<std::string>& assignments);

// Every field, in the order above.
std::string to_json(const Config& config);
// Absent fields are those of `base`; unknown ones and wrong types are an Error(format) that names them. Checked.
Config config_from_json(const std::string& text, const Config& base = {});

// The fields that `text` has are put into `config`, which is not checked; -> their names. Errors as above.
std::vector<std::string> set_fields_from_json(Config& config, const std::string& text);

// A field's value as JSON has it.
std::string field_text(const Config& config, const std::string& field);
// Those of `fields` in which two configurations differ.
std::vector<std::string> differing_fields(const Config& a, const Config& b, const std::vector<std::string>& fields);

}  // namespace vsplat
