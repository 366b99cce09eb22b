// The library's messages name options: here by those of this command.
#pragma once

namespace command {

// From here on, messages name --force rather than vsplat_input_options.force.
void name_options();

}  // namespace command
