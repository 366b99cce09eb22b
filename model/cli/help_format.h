// The text of --help. CLI11's own differs from version to version: some join the lines of examples, and write headings
// in capitals.
#pragma once
#include <CLI/CLI.hpp>
#include <string>

namespace command {

class HelpFormat : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override;
};

}  // namespace command
