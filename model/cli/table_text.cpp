#include "table_text.h"

#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>

#include "command.h"

namespace command {
namespace {

constexpr const char* table_endings[] = {".md", ".csv", ".json"};

template <class Quoted>
std::string line(const std::vector<std::string>& words, const std::string& begin, const std::string& between,
                 const std::string& end, const Quoted& quoted) {
  std::string out;
  for (const std::string& word : words) out += (out.empty() ? begin : between) + quoted(word);
  return out + end;
}

std::string markdown_line(const std::vector<std::string>& words) {
  return line(words, "| ", " | ", " |\n", [](const std::string& text) {
    std::string out;
    for (const char c : text) out += c == '|' ? "\\|" : std::string(1, c == '\n' || c == '\r' ? ' ' : c);
    return out;
  });
}

std::string csv_line(const std::vector<std::string>& words) {
  return line(words, "", ",", "\n", [](const std::string& text) {
    if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
    std::string out = "\"";
    for (const char c : text) out += c == '"' ? "\"\"" : std::string(1, c);
    return out + "\"";
  });
}

}  // namespace

std::string markdown(const TableLines& lines) {
  std::string out = markdown_line(lines.headings);
  for (std::size_t i = 0; i < lines.headings.size(); ++i) out += i < lines.texts ? "| --- " : "| ---: ";
  out += "|\n";
  for (const std::vector<std::string>& row : lines.rows) out += markdown_line(row);
  return out;
}

std::string csv(const TableLines& lines) {
  std::string out = csv_line(lines.names);
  for (const std::vector<std::string>& row : lines.rows) out += csv_line(row);
  return out;
}

std::string table_file(const std::string& path, const TableLines& lines, const nlohmann::ordered_json& json) {
  if (path.ends_with(".md")) return markdown(lines);
  if (path.ends_with(".csv")) return csv(lines);
  return json.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

void need_table_ending(const std::string& path) {
  if (std::none_of(std::begin(table_endings), std::end(table_endings),
                   [&](const char* ending) { return path.ends_with(ending); }))
    throw UsageError("--output is " + path + ": a file ending in .md, .csv or .json is expected");
}

}  // namespace command
