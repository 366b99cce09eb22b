#include "command_table.h"

#include <algorithm>
#include <cctype>

namespace command {
namespace {

// Splits "auto|cpu|gpu" into words; empty if a part is not a literal word.
std::vector<std::string> choices_of(const std::string& value) {
  std::vector<std::string> out(1);
  for (const char c : value) {
    if (c == '|')
      out.emplace_back();
    else if (std::islower(static_cast<unsigned char>(c)) || std::isdigit(static_cast<unsigned char>(c)))
      out.back() += c;
    else
      return {};
  }
  const bool words = std::none_of(out.begin(), out.end(), [](const std::string& word) { return word.empty(); });
  return out.size() > 1 && words ? out : std::vector<std::string>();
}

bool is_file(const std::string& value) {
  for (const char* kind :
       {"FILE", "DIR", "MODEL", "SCENE", "VIEWS", "CAMERAS", "CONFIG", "RUN", "MESH", "PICTURE", ".ply", ".json"})
    if (value.find(kind) != std::string::npos) return true;
  return false;
}

OptionRow row_of(const CLI::Option& option) {
  OptionRow out;
  for (const std::string& name : option.get_snames()) out.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) out.names.push_back("--" + name);
  if (option.get_positional()) out.names = {option.get_type_name()};
  if (option.get_type_size_max() > 0) out.value = option.get_type_name();
  out.text = option.get_description();
  out.group = option.get_group();
  out.choices = choices_of(out.value);
  out.file = out.choices.empty() && is_file(out.value);
  out.required = option.get_required();
  return out;
}

void add_rows(const CLI::App& app, const std::vector<std::string>& path, std::vector<CommandRow>& table) {
  CommandRow row;
  row.path = path;
  row.text = app.get_description();
  row.footer = app.get_footer();
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;
    (option->get_positional() ? row.positionals : row.options).push_back(row_of(*option));
  }
  const std::vector<const CLI::App*> subs = app.get_subcommands([](const CLI::App*) { return true; });
  for (const CLI::App* sub : subs) row.actions.push_back(sub->get_name());
  table.push_back(std::move(row));
  for (const CLI::App* sub : subs) {
    std::vector<std::string> below = path;
    below.push_back(sub->get_name());
    add_rows(*sub, below, table);
  }
}

}  // namespace

std::string CommandRow::name(const std::string& between) const {
  std::string out = "vsplat";
  for (const std::string& word : path) out += between + word;
  return out;
}

std::vector<CommandRow> command_table(const CLI::App& app) {
  std::vector<CommandRow> out;
  add_rows(app, {}, out);
  return out;
}

}  // namespace command
