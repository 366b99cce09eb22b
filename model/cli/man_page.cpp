#include "man_page.h"

#include <vsplat/vsplat.h>

#include <sstream>

namespace command {
namespace {

// Text for man(7), with its special characters escaped.
std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else if ((c == '.' || c == '\'') && (out.empty() || out.back() == '\n'))
      out += std::string("\\&") + c;
    else
      out += c;
  }
  return out;
}

// An argument of a macro, in quotes.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : escaped(text)) out += c == '"' ? std::string("\\(dq") : std::string(1, c);
  return out + "\"";
}

std::string option_text(const OptionRow& row) {
  std::string out = ".TP\n";
  std::string names;
  for (const std::string& name : row.names) names += (names.empty() ? "" : ", ") + ("\\fB" + escaped(name) + "\\fR");
  if (!row.value.empty() && row.names.front()[0] == '-') names += " \\fI" + escaped(row.value) + "\\fR";
  return out + names + "\n" + escaped(row.text) + (row.required ? " (required)" : "") + "\n";
}

std::string options_text(const CommandRow& row) {
  std::string out, group;
  for (const OptionRow& option : row.options) {
    if (option.group != group)
      out += option.group == "Options" ? ".SH OPTIONS\n" : ".SS " + quoted(option.group) + "\n";
    group = option.group;
    out += option_text(option);
  }
  return out;
}

// Indented lines are shown as they are; other lines are text, or a heading if indented lines follow.
std::string footer_text(const std::string& footer) {
  std::istringstream lines(footer);
  std::string out = ".SH NOTES\n", line;
  bool verbatim = false;
  while (std::getline(lines, line)) {
    const bool indented = !line.empty() && line[0] == ' ';
    if (indented != verbatim) out += indented ? ".nf\n" : ".fi\n.PP\n";
    verbatim = indented;
    out += escaped(line) + "\n";
  }
  return out + (verbatim ? ".fi\n" : "");
}

}  // namespace

std::string man_page(const std::vector<CommandRow>& table, std::size_t index) {
  const CommandRow& row = table.at(index);
  std::string out =
      ".TH " + quoted(row.name("-")) + " 1 \"\" " + quoted(std::string("vsplat ") + vsplat_version_string()) + "\n";
  out += ".SH NAME\n" + escaped(row.name("-")) + " \\- " + escaped(row.text) + "\n";
  out += ".SH SYNOPSIS\n.B " + escaped(row.name()) + "\n[\\fIoptions\\fR]";
  for (const OptionRow& positional : row.positionals)
    out += positional.required ? " \\fI" + escaped(positional.value) + "\\fR"
                               : " [\\fI" + escaped(positional.value) + "\\fR]";
  out += row.actions.empty() ? "\n" : " \\fIcommand\\fR ...\n";
  if (!row.positionals.empty()) out += ".SH ARGUMENTS\n";
  for (const OptionRow& positional : row.positionals) out += option_text(positional);
  out += options_text(row);
  if (!row.actions.empty()) out += ".SH COMMANDS\n";
  std::string also = row.path.empty() ? "" : "vsplat(1)";
  for (const std::string& action : row.actions) {
    std::vector<std::string> path = row.path;
    path.push_back(action);
    for (const CommandRow& other : table) {
      if (other.path != path) continue;
      out += ".TP\n\\fB" + escaped(other.name()) + "\\fR\n" + escaped(other.text) + "\n";
      also += (also.empty() ? "" : ", ") + other.name("-") + "(1)";
    }
  }
  if (!row.footer.empty()) out += footer_text(row.footer);
  if (!also.empty()) out += ".SH SEE ALSO\n" + escaped(also) + "\n";
  return out;
}

}  // namespace command
