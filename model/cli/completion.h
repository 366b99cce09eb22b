// Shell completion of the command line.
#pragma once
#include <string>
#include <vector>

#include "command_table.h"

namespace command {

// Scripts for the shell to source, or to install where it looks for them. They complete commands, options, and values
// that are paths or one of a few words.
std::string bash_completion(const std::vector<CommandRow>& table);
std::string zsh_completion(const std::vector<CommandRow>& table);
std::string fish_completion(const std::vector<CommandRow>& table);

}  // namespace command
