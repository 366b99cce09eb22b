#include "arguments.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <numeric>
#include <sstream>

#include "command.h"

namespace command {
namespace {

template <class T>
bool whole(const std::string& text, T& value) {
  const char* const begin = text.data() + (text.size() > 1 && text[0] == '+');
  const auto [end, error] = std::from_chars(begin, text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && begin != end;
}

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> out(1);
  for (const char c : text) {
    if (c == at)
      out.emplace_back();
    else
      out.back() += c;
  }
  return out;
}

[[noreturn]] void wrong(const std::string& option, const std::string& text, const std::string& expected) {
  throw UsageError(option + " is \"" + text + "\": " + expected + " expected");
}

// Levenshtein distance in which swapping two neighbours counts as one step.
std::size_t distance(const std::string& a, const std::string& b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  std::iota(d[0].begin(), d[0].end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i)
    for (std::size_t j = 1; j <= b.size(); ++j) {
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

std::string letters_of(const std::string& word) {
  return word.substr(std::min(word.find_first_not_of('-'), word.size()));
}

// Earlier names and other programs' names for options of some commands; "" stands for the positional argument.
struct CommonName {
  const char *name, *here;
};
constexpr CommonName common_names[] = {{"--out", "--output"},
                                       {"--output-path", "--output"},
                                       {"--output-file", "--output"},
                                       {"--outfile", "--output"},
                                       {"--in", ""},
                                       {"--input", ""},
                                       {"--input-path", ""},
                                       {"--input-file", ""},
                                       {"--iterations", "--steps"},
                                       {"--iters", "--steps"},
                                       {"--num-iters", "--steps"},
                                       {"--max-steps", "--steps"},
                                       {"--max-splats", "--max-gaussians"},
                                       {"--centre", "--center"},
                                       {"--fit", "--crop"}};

bool has_option(const CLI::App& app, const std::string& name) { return app.get_option_no_throw(name) != nullptr; }

const CLI::App* subcommand(const CLI::App& app, const std::string& name) {
  const std::vector<const CLI::App*> found =
      app.get_subcommands([&](const CLI::App* sub) { return sub->get_name() == name; });
  return found.empty() ? nullptr : found.front();
}

bool has_positional(const CLI::App& app) {
  const std::vector<const CLI::Option*> options = app.get_options();
  return std::any_of(options.begin(), options.end(), [](const CLI::Option* o) { return o->get_positional(); });
}

}  // namespace

bool is_digits(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

double number(const std::string& option, const std::string& text) {
  double value = 0;
  if (!whole(text, value) || !std::isfinite(value)) wrong(option, text, "a number");
  return value;
}

double positive_number(const std::string& option, const std::string& text, const std::string& what) {
  const double value = number(option, text);
  if (value < std::numeric_limits<float>::min() || value > std::numeric_limits<float>::max())
    wrong(option, text, "a positive " + what);
  return value;
}

double voxel_share(const std::string& option, const std::string& text) {
  if (text.empty()) return 0;
  const double value = number(option, text);
  if (!(value > 0 && value <= 1)) wrong(option, text, "a share of the voxels, above 0 and up to 1,");
  return value;
}

double percentage(const std::string& option, const std::string& text) {
  const std::string digits = text.substr(0, text.find_last_not_of("% ") + 1);
  char* end = nullptr;
  const double percent = std::strtod(digits.c_str(), &end);
  if (digits.empty() || *end != '\0' || !(percent >= 0) || !std::isfinite(percent))
    throw UsageError(option + " is " + text + ": a share of 0 or more is expected, 5% for instance");
  return percent / 100;
}

std::string share_text(double share) {
  std::ostringstream out;
  out << share;
  return out.str();
}

CLI::Validator positive() {
  const auto check = [](const std::string& text) {
    double value = 0;
    const bool good = whole(text, value) && std::isfinite(value) && value > 0;
    return good ? std::string() : "\"" + text + "\" found, a positive number expected";
  };
  return CLI::Validator(check, "");
}

std::uint64_t seed_value(const std::string& option, const std::string& text) {
  std::uint64_t value = 0;
  if (!whole(text, value)) wrong(option, text, "a whole number from 0 to 2^64 - 1");
  return value;
}

std::array<double, 3> triple(const std::string& option, const std::string& text) {
  const std::vector<std::string> parts = split(text, ',');
  std::array<double, 3> out{};
  bool good = parts.size() == 3;
  for (std::size_t i = 0; good && i < 3; ++i) good = whole(parts[i], out[i]) && std::isfinite(out[i]);
  if (!good) wrong(option, text, "three numbers with commas and without blanks, such as 0,-1.5,2,");
  return out;
}

std::array<float, 3> colour(const std::string& option, const std::string& text, bool* transparent) {
  struct Named {
    const char* name;
    std::uint32_t rgb;
  };
  // The basic colours of CSS, and orange.
  static constexpr Named known[] = {
      {"white", 0xffffff}, {"silver", 0xc0c0c0},  {"gray", 0x808080},    {"grey", 0x808080},   {"black", 0x000000},
      {"red", 0xff0000},   {"maroon", 0x800000},  {"yellow", 0xffff00},  {"olive", 0x808000},  {"lime", 0x00ff00},
      {"green", 0x008000}, {"aqua", 0x00ffff},    {"cyan", 0x00ffff},    {"teal", 0x008080},   {"blue", 0x0000ff},
      {"navy", 0x000080},  {"fuchsia", 0xff00ff}, {"magenta", 0xff00ff}, {"purple", 0x800080}, {"orange", 0xffa500}};
  const auto of = [](std::uint32_t rgb) {
    const auto channel = [&](int shift) { return static_cast<float>(rgb >> shift & 255) / 255; };
    return std::array<float, 3>{channel(16), channel(8), channel(0)};
  };
  if (transparent) *transparent = text == "transparent";
  if (transparent && *transparent) return {1, 1, 1};
  for (const Named& k : known)
    if (text == k.name) return of(k.rgb);
  if (text.size() == 7 && text[0] == '#') {
    std::uint32_t rgb = 0;
    const auto [end, error] = std::from_chars(text.data() + 1, text.data() + 7, rgb, 16);
    if (error == std::errc() && end == text.data() + 7) return of(rgb);
  }
  std::array<float, 3> out{};
  const std::vector<std::string> parts = split(text, ',');
  bool good = parts.size() == 3;
  for (std::size_t i = 0; good && i < 3; ++i) {
    double value = 0;
    good = whole(parts[i], value) && value >= 0 && value <= 1;
    out[i] = static_cast<float>(value);
  }
  if (good) return out;
  std::string names;
  for (const Named& k : known) names += std::string(", ") + k.name;
  wrong(option, text,
        std::string("r,g,b with each from 0 to 1, #rrggbb") + (transparent ? ", transparent" : "") + " or one of " +
            names.substr(2) + ",");
}

std::uint64_t samples(const std::string& option, const std::string& text) {
  if (text.empty() || text == "auto") return 0;
  if (text.size() != 1 || text[0] < '1' || text[0] > '8')
    throw UsageError(option + " is \"" + text + "\": 1 to 8 samples along a pixel's edge, or auto, expected");
  return static_cast<std::uint64_t>(text[0] - '0');
}

Size picture_size(const std::string& option, const std::string& text) {
  const std::vector<std::string> parts = split(text, 'x');
  Size out;
  constexpr int most = 16384;
  if (parts.size() != 2 || !whole(parts[0], out.width) || !whole(parts[1], out.height) || out.width < 1 ||
      out.height < 1 || out.width > most || out.height > most)
    wrong(option, text, "WIDTHxHEIGHT in pixels, 1 to 16384 each, such as 640x480,");
  return out;
}

std::vector<std::string> list(const std::string& option, const std::string& text) {
  std::vector<std::string> parts = split(text, ',');
  for (const std::string& part : parts)
    if (part.empty()) wrong(option, text, "a list with commas and no empty entries, such as a,b or @0,@3,");
  return parts;
}

bool is_set(const double (&three)[3]) { return three[0] != 0 || three[1] != 0 || three[2] != 0; }

std::string lower_case(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

void need_ending(const std::string& option, const std::string& path, const std::string& ending,
                 const std::string& reason) {
  if (path.empty()) return;
  const std::string found = lower_case(std::filesystem::path(path).extension());
  if (found != ending)
    throw UsageError(option + " is \"" + path + "\": a name that ends in " + ending + " expected" +
                     (reason.empty() ? "" : "; " + reason));
}

CameraChoice camera_choice(const std::string& option, const std::string& text) {
  constexpr int most = 10000;
  const std::string orbit = "orbit:", path = "path:";
  CameraChoice out;
  if (text.rfind(orbit, 0) == 0) {
    if (!whole(text.substr(orbit.size()), out.orbit) || out.orbit < 1 || out.orbit > most)
      wrong(option, text, "orbit:N with N from 1 to 10000, such as orbit:8,");
  } else if (text.rfind(path, 0) == 0) {
    const std::size_t colon = text.rfind(':');
    if (colon <= path.size() || !whole(text.substr(colon + 1), out.path) || out.path < 1 || out.path > most)
      wrong(option, text, "path:CAMERAS:N with N from 1 to 10000, such as path:cameras.json:60,");
    out.file = text.substr(path.size(), colon - path.size());
  } else {
    out.file = text;
  }
  return out;
}

std::vector<std::string> with_joined_numbers(const std::vector<std::string>& arguments) {
  const auto is_long = [](const std::string& s) {
    return s.size() > 2 && s[0] == '-' && s[1] == '-' && s.find('=') == std::string::npos;
  };
  const auto is_negative = [](const std::string& s) {
    return s.size() > 1 && s[0] == '-' && (std::isdigit(static_cast<unsigned char>(s[1])) || s[1] == '.');
  };
  std::vector<std::string> out;
  for (const std::string& argument : arguments) {
    if (!out.empty() && is_long(out.back()) && is_negative(argument))
      out.back() += "=" + argument;
    else
      out.push_back(argument);
  }
  return out;
}

std::vector<std::string> with_names_of_here(const CLI::App& app, const std::vector<std::string>& arguments) {
  const CLI::App* scope = &app;
  std::vector<std::string> out;
  bool options_end = false;
  for (std::string argument : arguments) {
    const bool is_command = out.empty() || (out.size() == 1 && out[0] == "help");
    const bool is_suite = scope->get_name() == "bench" && !out.back().starts_with("--");
    if ((is_command || is_suite) && argument == "refine") argument = "fit";  // its earlier name
    options_end = options_end || argument == "--";
    if (const CLI::App* sub = options_end ? nullptr : subcommand(*scope, argument)) scope = sub;
    const std::size_t equals = argument.find('=');
    const std::string name = argument.substr(0, equals);
    const auto known = std::find_if(std::begin(common_names), std::end(common_names),
                                    [&](const CommonName& c) { return name == c.name; });
    const bool foreign = !options_end && known != std::end(common_names) && !has_option(*scope, name);
    const std::string here = foreign ? known->here : "";
    if (foreign && here.empty() && has_positional(*scope)) {
      if (equals != std::string::npos) out.push_back(argument.substr(equals + 1));
    } else if (!here.empty() && has_option(*scope, here)) {
      out.push_back(here + argument.substr(std::min(equals, argument.size())));
    } else {
      out.push_back(argument);
    }
  }
  return out;
}

std::vector<std::string> with_values(const CLI::App& app, const std::vector<std::string>& arguments) {
  const CLI::App* scope = &app;
  std::vector<std::string> out;
  const CLI::Option* before = nullptr;  // the option whose value may come now
  for (const std::string& argument : arguments) {
    if (argument == "--") before = nullptr, scope = nullptr;
    const bool is_name = scope && argument.starts_with("-");
    const std::size_t equals = argument.find('=');
    const CLI::Option* option = is_name ? scope->get_option_no_throw(argument.substr(0, equals)) : nullptr;
    if (before && before->get_items_expected_min() > 0 && option)
      throw UsageError(out.back() + " has no value: " + argument.substr(0, equals) + " follows");
    if (before && before->get_items_expected_min() == 0 && !is_digits(argument))
      out.back() += "=" + before->get_default_str();
    before = option && equals == std::string::npos && option->get_items_expected_max() > 0 ? option : nullptr;
    if (const CLI::App* sub = scope && !is_name ? subcommand(*scope, argument) : nullptr) scope = sub;
    out.push_back(argument);
  }
  if (before && before->get_items_expected_min() == 0) out.back() += "=" + before->get_default_str();
  return out;
}

void refuse_empty_values(const std::vector<std::string>& arguments) {
  const std::string hint = " (a variable that is not set?)";
  std::string before;
  for (const std::string& argument : arguments) {
    if (argument.empty())
      throw UsageError(before.empty() ? "an argument is empty" + hint : "empty argument after " + before + hint);
    if (argument.size() > 3 && argument.rfind("--", 0) == 0 && argument.find('=') == argument.size() - 1)
      throw UsageError(argument + " has no value" + hint);
    before = argument;
  }
}

std::string nearest(const std::string& word, const std::vector<std::string>& names) {
  const std::string given = letters_of(word);
  std::string best;
  // An abbreviation counts by the whole word; otherwise allows as many wrong letters as leave most of the word.
  std::size_t least = std::max<std::size_t>(1, (given.size() + 1) / 3) + 1;
  for (const std::string& name : names) {
    if ((name[0] == '-') != (word[0] == '-')) continue;
    const std::string letters = letters_of(name);
    const bool cut = given.size() > 1 && letters.size() > given.size() && letters.rfind(given, 0) == 0;
    const std::size_t d = cut ? 1 : distance(given, letters);
    if (d < least) least = d, best = name;
  }
  return best;
}

std::string unknown_text(const CLI::App& app) {
  const CLI::App* scope = &app;
  while (!scope->get_subcommands().empty()) scope = scope->get_subcommands().front();
  std::vector<std::string> names;
  for (const CLI::Option* option : scope->get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  for (const CLI::App* sub : scope->get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(sub->get_name());
  std::string text, hints;
  for (const std::string& argument : scope->remaining(true)) {
    const std::string word = argument.substr(0, argument.find('='));
    text += (text.empty() ? "" : ", ") + argument;
    const std::string hint = nearest(word, names);
    if (!hint.empty()) hints += (hints.empty() ? "" : ", ") + hint;
  }
  if (text.empty()) return "";
  if (scope == &app && text[0] != '-')
    return "unknown command " + text + (hints.empty() ? "" : "; did you mean " + hints + "?");
  return (scope == &app ? "" : scope->get_name() + ": ") + "unknown argument" +
         (text.find(", ") == std::string::npos ? " " : "s ") + text +
         (hints.empty() ? "" : "; did you mean " + hints + "?");
}

}  // namespace command
