// vsplat help and vsplat completion: the sub-commands' options for people, man and shells.
#include <cstdio>
#include <filesystem>

#include "arguments.h"
#include "command.h"
#include "completion.h"
#include "man_page.h"
#include "outputs.h"

namespace command {
namespace {

struct HelpOptions {
  std::vector<std::string> words;
  bool man = false;
  std::string pages;
};

// The sub-command with these names; UsageError if there is none.
const CLI::App& find(const CLI::App& root, const std::vector<std::string>& words) {
  const CLI::App* at = &root;
  std::string name = "vsplat";
  for (const std::string& word : words) {
    const CLI::App* next = nullptr;
    std::vector<std::string> names;
    for (const CLI::App* sub : at->get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(sub->get_name());
      if (sub->get_name() == word) next = sub;
    }
    if (!next) {
      const std::string near = nearest(word, names);
      throw UsageError(name + " has no command " + word + (near.empty() ? "" : "; did you mean " + near + "?"));
    }
    name += " " + word;
    at = next;
  }
  return *at;
}

void help(const CLI::App& root, const HelpOptions& o) {
  const CLI::App& asked = find(root, o.words);
  const std::vector<CommandRow> table = command_table(root);
  const auto page_of = [&](const CommandRow& row) {
    return (std::filesystem::path(o.pages) / (row.name("-") + ".1")).string();
  };
  Outputs outputs(false);
  if (!o.pages.empty())
    for (const CommandRow& row : table) outputs.expect(page_of(row));
  for (std::size_t i = 0; i < table.size(); ++i) {
    if (!o.pages.empty()) {
      write_text(outputs.begin(page_of(table[i])), man_page(table, i));
    } else if (table[i].path == o.words) {
      const std::string text =
          o.man ? man_page(table, i)
                : asked.get_formatter()->make_help(&asked, table[i].name(), CLI::AppFormatMode::Normal);
      std::fputs(text.c_str(), stdout);
    }
  }
  outputs.commit();
}

}  // namespace

void add_help(CLI::App& app, Run& run) {
  auto o = std::make_shared<HelpOptions>();
  CLI::App* sub = app.add_subcommand("help", "Show a command's options, as --help does");
  sub->add_option("command", o->words, "The command (default: vsplat itself)")->type_name("COMMAND");
  // For packagers: the same as man pages, one, or all into a folder.
  sub->add_flag("--man", o->man)->group("");
  sub->add_option("--man-pages", o->pages)->group("");
  sub->footer("Examples:\n  vsplat help reconstruct\n  vsplat help weights convert");
  sub->callback([o, &app, &run] { run = [o, &app] { help(app, *o); }; });
}

void add_completion(CLI::App& app, Run& run) {
  auto shell = std::make_shared<std::string>();
  CLI::App* sub = app.add_subcommand("completion", "Print a script with which a shell completes vsplat's command line");
  sub->add_option("shell", *shell, "The shell")
      ->required()
      ->check(one_of({"bash", "zsh", "fish"}))
      ->type_name("bash|zsh|fish");
  sub->footer(
      "An installed vsplat has these scripts where the shells look for them. Without installation:\n"
      "Examples:\n"
      "  source <(vsplat completion bash)\n"
      "  vsplat completion zsh > ~/.zfunc/_vsplat\n"
      "  vsplat completion fish > ~/.config/fish/completions/vsplat.fish");
  sub->callback([shell, &app, &run] {
    run = [shell, &app] {
      const std::vector<CommandRow> table = command_table(app);
      const std::string text = *shell == "bash"  ? bash_completion(table)
                               : *shell == "zsh" ? zsh_completion(table)
                                                 : fish_completion(table);
      std::fputs(text.c_str(), stdout);
    };
  });
}

}  // namespace command
