// The sub-commands and their options as plain rows, read from the parser itself. Man pages and shell completion are
// made from these, so they always agree with --help.
#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace command {

struct OptionRow {
  std::vector<std::string> names;    // "-m", "--model"; for a positional its single displayed name
  std::string value;                 // the value's name in --help; "" for a flag
  std::string text;                  // what it does
  std::string group;                 // its heading in --help
  std::vector<std::string> choices;  // if the value is one of a few words
  bool file = false;                 // the value is a path
  bool required = false;
};

struct CommandRow {
  std::vector<std::string> path;                // {}, {"weights"}, {"weights", "info"}
  std::string text;                             // what it does
  std::vector<OptionRow> positionals, options;  // without hidden ones
  std::vector<std::string> actions;             // names of its sub-commands
  std::string footer;                           // text below the options in --help: examples and more

  std::string name(const std::string& between = " ") const;  // "vsplat weights info"
};

// The command itself, then each sub-command followed by its own sub-commands, in the order of --help.
std::vector<CommandRow> command_table(const CLI::App& app);

}  // namespace command
