// A table as Markdown, CSV and JSON.
#pragma once
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace command {

struct TableLines {
  std::vector<std::string> names, headings;  // of the columns: in CSV, and in Markdown
  std::size_t texts = 0;                     // the first columns are texts; numbers are set to the right
  std::vector<std::vector<std::string>> rows;
};

std::string markdown(const TableLines& lines);
std::string csv(const TableLines& lines);

// The content of a file, by the ending of its path: .md, .csv, else the JSON.
std::string table_file(const std::string& path, const TableLines& lines, const nlohmann::ordered_json& json);
// UsageError unless it ends in .md, .csv or .json.
void need_table_ending(const std::string& path);

}  // namespace command
