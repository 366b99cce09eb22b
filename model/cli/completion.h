// Completion of the command line in shells.
#pragma once
#include <string>
#include <vector>

#include "command_table.h"

namespace command {

// Scripts to be read by the shell, or put where it looks for them: commands, options, and values where they are one of
// a few words or paths.
std::string bash_completion(const std::vector<CommandRow>& table);
std::string zsh_completion(const std::vector<CommandRow>& table);
std::string fish_completion(const std::vector<CommandRow>& table);

}  // namespace command
