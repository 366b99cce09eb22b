#include "help_format.h"

#include <algorithm>
#include <sstream>
#include <vector>

namespace command {
namespace {

constexpr std::size_t text_column = 38, line_width = 118;

// A name, and beside it, or below it if it is long, what it means, in lines of whole words.
std::string row(const std::string& name, const std::string& text) {
  std::string out = "  " + name;
  if (text.empty()) return out + "\n";
  if (out.size() >= text_column) out += "\n" + std::string(text_column, ' ');
  out.resize(std::max(out.size(), text_column), ' ');
  std::istringstream words(text);
  std::size_t at = text_column;
  for (std::string word; words >> word;) {
    if (at > text_column && at + 1 + word.size() > line_width) {
      out += "\n" + std::string(text_column, ' ');
      at = text_column;
    }
    if (at > text_column) out += " ", ++at;
    out += word;
    at += word.size();
  }
  return out + "\n";
}

// The value's name, with dots if there may be several.
std::string value_text(const CLI::Option& option) {
  const std::string out = option.get_type_name();
  return option.get_items_expected_max() > 1 && out.find("...") == std::string::npos ? out + "..." : out;
}

std::string usage_of(const CLI::Option& positional) {
  const std::string out = value_text(positional);
  return positional.get_required() ? out : "[" + out + "]";
}

std::string heading_of(const CLI::Option& option) {
  std::string out = option.get_positional() ? value_text(option) : option.get_name(false, true);
  if (!option.get_positional() && option.get_type_size_max() > 0) out += " " + value_text(option);
  if (!option.get_default_str().empty()) out += "=" + option.get_default_str();
  return option.get_required() ? out + " REQUIRED" : out;
}

}  // namespace

std::string HelpFormat::make_help(const CLI::App* app, std::string name, CLI::AppFormatMode) const {
  const std::vector<const CLI::App*> commands = app->get_subcommands([](const CLI::App*) { return true; });
  std::string usage = "\nUsage: " + name + " [OPTIONS]", positionals, others;
  for (const CLI::Option* option : app->get_options())
    if (option->get_positional() && !option->get_group().empty()) {
      usage += " " + usage_of(*option);
      positionals += row(heading_of(*option), option->get_description());
    }
  if (!commands.empty()) usage += app->get_require_subcommand_min() == 0 ? " [SUBCOMMAND]" : " SUBCOMMAND";
  if (!positionals.empty()) positionals = "\nPositionals:\n" + positionals;
  for (const std::string& group : app->get_groups()) {
    std::string rows;
    for (const CLI::Option* option : app->get_options())
      if (option->nonpositional() && option->get_group() == group)
        rows += row(heading_of(*option), option->get_description());
    if (!group.empty() && !rows.empty()) others += "\n" + (group == "OPTIONS" ? "Options" : group) + ":\n" + rows;
  }
  if (!commands.empty()) others += "\nSubcommands:\n";
  for (const CLI::App* command : commands) others += row(command->get_name(), command->get_description());
  return app->get_description() + usage + "\n" + positionals + others + "\n" + app->get_footer() + "\n";
}

}  // namespace command
