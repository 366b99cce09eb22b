#include "model/train/run_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string_view>

#include "runtime/fail.h"
#include "runtime/files/file.h"

namespace vsplat {
namespace {

constexpr std::uintmax_t kLargest = std::uintmax_t{256} << 20;  // bytes: two million lines
constexpr std::size_t kMostPoints = 2000;                       // more points than a screen has pixels

enum class Merge { mean, largest, last };
const std::map<std::string, Merge, std::less<>> kColumns = {{"step", Merge::last},
                                                            {"seconds", Merge::last},
                                                            {"lr", Merge::last},
                                                            {"temperature", Merge::last},
                                                            {"loss", Merge::mean},
                                                            {"psnr", Merge::mean},
                                                            {"psnr_coarse", Merge::mean},
                                                            {"selected", Merge::mean},
                                                            {"most_selected", Merge::largest},
                                                            {"gradient_norm", Merge::mean},
                                                            {"intersections", Merge::largest}};

// Removes the next line from the text and returns it.
std::string_view next_line(std::string_view& text) {
  const std::size_t end = std::min(text.find('\n'), text.size());
  std::string_view line = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> out;
  for (;;) {
    const std::size_t comma = line.find(',');
    out.push_back(line.substr(0, comma));
    if (comma == std::string_view::npos) return out;
    line.remove_prefix(comma + 1);
  }
}

bool read_number(std::string_view text, double& out) {
  const auto read = std::from_chars(text.data(), text.data() + text.size(), out);
  return read.ec == std::errc() && read.ptr == text.data() + text.size();
}

// Merges the values [begin, end).
double merged(const std::vector<double>& values, std::size_t begin, std::size_t end, Merge how) {
  if (how == Merge::last) return values[end - 1];
  double sum = 0, largest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = begin; i < end; ++i) {
    sum += values[i];
    largest = std::max(largest, values[i]);
  }
  // As many digits as the log has: more would make up most of the page.
  return how == Merge::largest ? largest
                               : std::strtod(fmt::format("{:.6g}", sum / double(end - begin)).c_str(), nullptr);
}

void merge(RunLog& log) {
  const std::size_t lines = log.columns["step"].size(), each = (lines + kMostPoints - 1) / kMostPoints;
  if (each <= 1) return;
  log.merged = static_cast<long>(each);
  for (auto& [name, values] : log.columns) {
    std::vector<double> points;
    for (std::size_t i = 0; i < lines; i += each)
      points.push_back(merged(values, i, std::min(i + each, lines), kColumns.at(name)));
    values = std::move(points);
  }
}

// Whether the line belongs to the log; stores its values in `values`.
bool read_line(std::string_view line, const std::vector<std::string_view>& names, std::vector<double>& values) {
  const std::vector<std::string_view> fields = fields_of(line);
  if (fields.size() != names.size()) return false;
  values.resize(names.size());
  for (std::size_t i = 0; i < names.size(); ++i)
    if (kColumns.contains(names[i]) && !read_number(fields[i], values[i])) return false;
  return true;
}

}  // namespace

RunLog read_run_log(const std::string& path) {
  std::error_code problem;
  if (const auto size = std::filesystem::file_size(path, problem); !problem && size > kLargest)
    fail(Status::format, "{}: has {} bytes; a log of at most {} is expected", path, size, kLargest);
  const std::vector<unsigned char> bytes = read_file(path);
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::vector<std::string_view> names = fields_of(next_line(text));
  const auto place = [&](std::string_view name) {
    return static_cast<std::size_t>(std::find(names.begin(), names.end(), name) - names.begin());
  };
  const std::size_t step = place("step"), seconds = place("seconds");
  if (step == names.size() || seconds == names.size())
    fail(Status::format, "{}: its first line is not that of a log; columns step and seconds are expected", path);
  RunLog out;
  for (const std::string_view name : names)
    if (kColumns.contains(name)) out.columns.emplace(name, 0);
  std::vector<double> values;
  double before = 0;
  while (!text.empty()) {
    const std::string_view line = next_line(text);
    if (!read_line(line, names, values) || !std::isfinite(values[step]) || !(values[step] > before) ||
        !std::isfinite(values[seconds])) {
      ++out.damaged;
      continue;
    }
    before = values[step];
    for (std::size_t i = 0; i < names.size(); ++i)
      if (place(names[i]) == i && kColumns.contains(names[i]))
        out.columns.find(std::string(names[i]))
            ->second.push_back(std::isfinite(values[i]) ? values[i] : std::numeric_limits<double>::quiet_NaN());
  }
  merge(out);
  return out;
}

}  // namespace vsplat
