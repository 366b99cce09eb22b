// Manual pages in man(7) format.
#pragma once
#include <string>
#include <vector>

#include "command_table.h"

namespace command {

// The page of table[index], named `CommandRow::name("-")`.
std::string man_page(const std::vector<CommandRow>& table, std::size_t index);

}  // namespace command
