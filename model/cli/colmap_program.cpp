#include "colmap_program.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <stdexcept>
#include <utility>

#include "external_program.h"

namespace command {
namespace {

constexpr double help_seconds = 60;  // seconds to print its help
constexpr std::pair<int, int> oldest = {3, 8}, newest = {4, 99};
constexpr const char* how_to_install =
    "apt install colmap (Debian, Ubuntu), brew install colmap (macOS), conda install -c conda-forge colmap (any "
    "system), or https://colmap.github.io/install.html";

std::string find_colmap(const std::string& named) {
  const std::string out = find_program(named);
  if (!out.empty()) return out;
  throw std::runtime_error(named == "colmap"
                               ? std::string("COLMAP, which finds the cameras, is not installed: PATH has no program "
                                             "colmap. Install it: ") +
                                     how_to_install + ". --colmap PROGRAM names one that is elsewhere"
                               : "--colmap " + named + ": no such program");
}

// The two numbers after "COLMAP "; -1 if there are none.
std::pair<int, int> version_in(const std::string& text) {
  const std::string before = "COLMAP ";
  for (std::size_t at = text.find(before); at != std::string::npos; at = text.find(before, at + 1)) {
    const char* from = text.c_str() + at + before.size();
    char* end = nullptr;
    const long major = std::strtol(from, &end, 10);
    if (end == from || *end != '.') continue;
    return {static_cast<int>(major), static_cast<int>(std::strtol(end + 1, nullptr, 10))};
  }
  return {-1, -1};
}

// Whether the help of a command lists --NAME.
bool lists(const std::string& help, const std::string& name) {
  const std::string option = "--" + name;
  for (std::size_t at = help.find(option); at != std::string::npos; at = help.find(option, at + 1)) {
    const char after = at + option.size() < help.size() ? help[at + option.size()] : '\n';
    if (std::isspace(static_cast<unsigned char>(after)) != 0) return true;
  }
  return false;
}

}  // namespace

ColmapProgram::ColmapProgram(const std::string& named) : program_(find_colmap(named)) {
  const ProgramOutput help = output_of(program_, {"help"}, help_seconds);
  const std::pair<int, int> found = version_in(help.text);
  if (found.first < 0)
    throw std::runtime_error(program_ + " is not COLMAP: `" + program_ + " help` prints no version of it" +
                             (help.how.empty() ? "" : " (" + help.how + ")") +
                             (help.text.empty() ? "" : "; its last lines:" + last_lines(help.text, 3)));
  version_ = std::to_string(found.first) + "." + std::to_string(found.second);
  if (found < oldest)
    throw std::runtime_error(program_ + " is COLMAP " + version_ +
                             "; version 3.8 or later is needed: " + how_to_install);
  newer_ = found > newest;
  cuda_ = help.text.find("with CUDA") != std::string::npos;
}

std::vector<std::string> ColmapProgram::arguments(const std::string& name, const std::vector<ColmapOption>& options) {
  if (help_.count(name) == 0) help_[name] = output_of(program_, {name, "--help"}, help_seconds).text;
  const std::string& help = help_[name];
  std::vector<std::string> out = {name};
  for (const ColmapOption& option : options) {
    const auto known = std::find_if(option.names.begin(), option.names.end(),
                                    [&](const std::string& any) { return lists(help, any); });
    if (known != option.names.end()) {
      out.insert(out.end(), {"--" + *known, option.value});
    } else if (option.needed) {
      throw std::runtime_error(program_ + " (COLMAP " + version_ + "): `" + name + " --help` lists no option --" +
                               option.names.front() + ", so this version cannot be used; use one from 3.8 to 4");
    }
  }
  return out;
}

bool ColmapProgram::run(const std::string& name, const std::vector<ColmapOption>& options,
                        const std::filesystem::path& log, const std::function<void(const std::string&)>& on_line,
                        const std::function<bool(const std::string&)>& may_fail) {
  const ProgramOutput end = run_logged(program_, arguments(name, options), log, on_line);
  if (end.how.empty()) return true;
  if (end.ended && may_fail && may_fail(end.text)) return false;
  throw std::runtime_error(
      "COLMAP's " + name + " failed (" + end.how + ")" +
      (end.text.empty() ? std::string(" and printed nothing")
                        : "; its last lines:" + last_lines(end.text, 5) + "\nAll of them are in " + log.string()));
}

}  // namespace command
