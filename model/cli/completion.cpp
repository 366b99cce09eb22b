#include "completion.h"

namespace command {
namespace {

std::string joined(const std::vector<std::string>& words, const std::string& between) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? "" : between) + word;
  return out;
}

// "weights info"; "" for the command itself.
std::string place(const CommandRow& row) { return joined(row.path, " "); }

// In single quotes, valid in all three shells.
std::string quoted(const std::string& text, const std::string& quote_inside = "'\\''") {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? quote_inside : std::string(1, c);
  return out + "'";
}

// All commands as a pattern of `case`.
std::string all_places(const std::vector<CommandRow>& table) {
  std::string out;
  for (const CommandRow& row : table)
    if (!row.path.empty()) out += (out.empty() ? "" : " | ") + quoted(place(row));
  return out;
}

}  // namespace

std::string bash_completion(const std::vector<CommandRow>& table) {
  std::string out =
      "# Completion of vsplat's command line in bash, made by `vsplat completion bash`.\n"
      "_vsplat() {\n"
      "  local cur=${COMP_WORDS[COMP_CWORD]} prev=${COMP_WORDS[COMP_CWORD - 1]} at= i words=\n"
      "  COMPREPLY=()\n"
      "  for ((i = 1; i < COMP_CWORD; i++)); do\n"
      "    case \"${at:+$at }${COMP_WORDS[i]}\" in\n"
      "      " +
      all_places(table) +
      ") at=\"${at:+$at }${COMP_WORDS[i]}\" ;;\n"
      "    esac\n"
      "  done\n"
      "  case \"$at:$prev\" in\n";
  for (const CommandRow& row : table)
    for (const OptionRow& option : row.options) {
      if (option.value.empty()) continue;
      std::vector<std::string> patterns;
      for (const std::string& name : option.names) patterns.push_back(quoted(place(row) + ":" + name));
      out += "    " + joined(patterns, " | ") + ") ";
      if (!option.choices.empty())
        out += "COMPREPLY=($(compgen -W '" + joined(option.choices, " ") + "' -- \"$cur\")); ";
      if (option.file) out += "compopt -o default 2>/dev/null; ";
      out += "return ;;\n";
    }
  out += "  esac\n  case \"$at:$cur\" in\n";
  for (const CommandRow& row : table) {
    std::vector<std::string> names;
    for (const OptionRow& option : row.options) names.insert(names.end(), option.names.begin(), option.names.end());
    out += "    " + quoted(place(row) + ":-") + "*) words='" + joined(names, " ") + "' ;;\n";
    std::vector<std::string> values = row.actions;
    bool files = false;
    for (const OptionRow& positional : row.positionals) {
      values.insert(values.end(), positional.choices.begin(), positional.choices.end());
      files |= positional.file;
    }
    out += "    " + quoted(place(row) + ":") + "*) words='" + joined(values, " ") + "'" +
           (files ? "; compopt -o default 2>/dev/null" : "") + " ;;\n";
  }
  return out +
         "  esac\n"
         "  COMPREPLY=($(compgen -W \"$words\" -- \"$cur\"))\n"
         "}\n"
         "complete -F _vsplat vsplat\n";
}

namespace {

// The part of an _arguments entry that describes a value: ":name:completion".
std::string zsh_value(const OptionRow& row) {
  std::string name;
  for (const char c : row.value) name += c == ':' ? "\\:" : std::string(1, c);
  return ":" + name + ":" +
         (!row.choices.empty() ? "(" + joined(row.choices, " ") + ")"
          : row.file           ? std::string("_files")
                               : std::string(" "));
}

std::string zsh_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

}  // namespace

std::string zsh_completion(const std::vector<CommandRow>& table) {
  std::string out =
      "#compdef vsplat\n"
      "# Completion of vsplat's command line in zsh, made by `vsplat completion zsh`.\n"
      "_vsplat() {\n"
      "  local at= i words_from=1\n"
      "  for ((i = 2; i < CURRENT; i++)); do\n"
      "    case \"${at:+$at }${words[i]}\" in\n"
      "      (" +
      all_places(table) +
      ") at=\"${at:+$at }${words[i]}\"; words_from=$i ;;\n"
      "    esac\n"
      "  done\n"
      "  words=(\"${(@)words[words_from,-1]}\")\n"
      "  ((CURRENT -= words_from - 1))\n"
      "  case \"$at\" in\n";
  for (const CommandRow& row : table) {
    out += "    (" + quoted(place(row)) + ")\n";
    if (!row.actions.empty()) {
      std::vector<std::string> known;
      for (const std::string& action : row.actions)
        for (const CommandRow& other : table)
          if (other.path.size() == row.path.size() + 1 && other.path.back() == action &&
              std::equal(row.path.begin(), row.path.end(), other.path.begin()))
            known.push_back(quoted(action + ":" + zsh_text(other.text)));
      out += "      local -a commands=(" + joined(known, " ") + ")\n      _describe command commands\n";
    }
    out += "      _arguments -s";
    for (const OptionRow& option : row.options)
      for (const std::string& name : option.names)
        out += " \\\n        " + quoted("(" + joined(option.names, " ") + ")" + name + "[" + zsh_text(option.text) +
                                        "]" + (option.value.empty() ? "" : zsh_value(option)));
    for (const OptionRow& positional : row.positionals) out += " \\\n        " + quoted("*" + zsh_value(positional));
    out += "\n      ;;\n";
  }
  return out +
         "  esac\n"
         "}\n"
         "_vsplat \"$@\"\n";
}

std::string fish_completion(const std::vector<CommandRow>& table) {
  const auto fish = [](const std::string& text) {
    std::string out;
    for (const char c : text) out += c == '\\' ? std::string("\\\\") : std::string(1, c);
    return quoted(out, "\\'");
  };
  std::string places;
  for (const CommandRow& row : table)
    if (!row.path.empty()) places += " " + quoted(place(row));
  std::string out =
      "# Completion of vsplat's command line in fish, made by `vsplat completion fish`.\n"
      "function __vsplat_at\n"
      "  set -l at\n"
      "  set -l places" +
      places +
      "\n"
      "  for word in (commandline -opc)[2..-1]\n"
      "    contains -- (string join ' ' $at $word) $places; and set at $at $word\n"
      "  end\n"
      "  test (string join ' ' $at) = \"$argv[1]\"\n"
      "end\n"
      "complete -c vsplat -f\n";
  for (const CommandRow& row : table) {
    const std::string begin = "complete -c vsplat -n " + fish("__vsplat_at \"" + place(row) + "\"");
    for (const CommandRow& other : table)
      if (other.path.size() == row.path.size() + 1 && std::equal(row.path.begin(), row.path.end(), other.path.begin()))
        out += begin + " -a " + other.path.back() + " -d " + fish(other.text) + "\n";
    for (const OptionRow& positional : row.positionals) {
      if (positional.file) out += begin + " -F\n";
      if (!positional.choices.empty()) out += begin + " -a " + fish(joined(positional.choices, " ")) + "\n";
    }
    for (const OptionRow& option : row.options) {
      out += begin;
      for (const std::string& name : option.names)
        out += name[1] == '-' ? " -l " + name.substr(2) : " -s " + name.substr(1);
      if (!option.value.empty()) out += option.file ? " -r -F" : " -x";
      if (!option.choices.empty()) out += " -a " + fish(joined(option.choices, " "));
      out += " -d " + fish(option.text) + "\n";
    }
  }
  return out;
}

}  // namespace command
