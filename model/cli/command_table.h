// The sub-commands and their options as plain rows, read from what is parsed with: man pages and shell completion are
// made of them, so that they cannot tell anything else than --help.
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace command {

struct OptionRow {
  std::vector<std::string> names;    // "-m", "--model"; of a positional one name, as it is shown
  std::string value;                 // what --help calls the value; "" for a flag
  std::string text;                  // what it does
  std::string group;                 // its heading in --help
  std::vector<std::string> choices;  // where the value is one of a few words
  bool file = false;                 // the value is a path
  bool required = false;
};

struct CommandRow {
  std::vector<std::string> path;                // {}, {"weights"}, {"weights", "info"}
  std::string text;                             // what it does
  std::vector<OptionRow> positionals, options;  // hidden ones left out
  std::vector<std::string> actions;             // names of its sub-commands
  std::string footer;                           // examples and what else is below the options in --help

  std::string name(const std::string& between = " ") const;  // "vsplat weights info"
};

// The command itself, then each sub-command followed by its own, in the order of --help.
std::vector<CommandRow> command_table(const CLI::App& app);

}  // namespace command
