#include "request_fields.h"

#include <fstream>
#include <sstream>
#include <stdexcept>

namespace command {
namespace {

namespace fs = std::filesystem;
using nlohmann::ordered_json;

constexpr std::uintmax_t largest_file = 1 << 20;
constexpr int deepest = 32;  // writing a value, as for an error, takes some stack for each list around it

// "[json.exception.parse_error.101] parse error at line 1, column 2: ..." without what is in brackets.
std::string fault(const ordered_json::exception& e) {
  const std::string text = e.what();
  const std::size_t end = text.find("] ");
  constexpr int overflow = 406;
  return (e.id == overflow ? ": holds a number that is too large: " : ": is not valid JSON: ") +
         text.substr(end == std::string::npos ? 0 : end + 2);
}

}  // namespace

ordered_json parsed_file(const std::string& path, const std::string& what) {
  std::error_code error;
  if (!fs::is_regular_file(path, error)) throw std::runtime_error(path + ": is not a file; " + what + " is expected");
  if (fs::file_size(path, error) > largest_file)
    throw std::runtime_error(path + ": more than 1 MiB, too much for " + what);
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) throw std::runtime_error(path + ": cannot be read");
  const auto is_shallow = [&](int depth, ordered_json::parse_event_t, const ordered_json&) {
    if (depth <= deepest) return true;
    throw std::runtime_error(path + ": lists and objects are nested more than " + std::to_string(deepest) + " deep");
  };
  try {
    return ordered_json::parse(text.str(), is_shallow);
  } catch (const ordered_json::exception& e) {
    throw std::runtime_error(path + fault(e));
  }
}

std::string short_text(const ordered_json& value) {
  const std::string text = value.dump(-1, ' ', true, ordered_json::error_handler_t::replace);
  return text.size() > 60 ? text.substr(0, 60) + "..." : text;
}

Fields::Fields(const ordered_json& object, std::string where, fs::path folder)
    : object_(object), where_(std::move(where)), folder_(std::move(folder)) {
  if (!object_.is_object()) wrong(where_, "an object", object_);
}

std::string Fields::text(const char* name, const std::optional<std::string>& otherwise) {
  const ordered_json* value = find(name, !otherwise.has_value());
  if (!value) return *otherwise;
  if (!value->is_string() || value->get<std::string>().empty())
    wrong(path_of(name), "a text that is not empty", *value);
  return value->get<std::string>();
}

std::string Fields::one_of_two(const char* name, const char* first, const char* second) {
  const ordered_json* value = find(name, false);
  if (!value) return first;
  if (*value != first && *value != second) wrong(path_of(name), std::string(first) + " or " + second, *value);
  return value->get<std::string>();
}

std::string Fields::path(const char* name) {
  const std::string given = text(name, "");
  return given.empty() ? "" : (folder_ / given).string();
}

std::vector<std::string> Fields::paths(const char* name) {
  const ordered_json& list = *find(name, true);
  if (!list.is_array() || list.empty()) wrong(path_of(name), "a list of folders", list);
  std::vector<std::string> out;
  for (const ordered_json& each : list) {
    if (!each.is_string() || each.get<std::string>().empty()) wrong(path_of(name), "a list of folders", list);
    out.push_back((folder_ / each.get<std::string>()).string());
  }
  return out;
}

double Fields::number(const char* name, double low, double high, double otherwise) {
  const ordered_json* value = find(name, false);
  if (!value) return otherwise;
  if (!value->is_number() || !(value->get<double>() >= low && value->get<double>() <= high))
    wrong(path_of(name), "a number from " + ordered_json(low).dump() + " to " + ordered_json(high).dump(), *value);
  return value->get<double>();
}

std::uint64_t Fields::count(const char* name, std::uint64_t low, std::uint64_t high, std::uint64_t otherwise) {
  const ordered_json* value = find(name, false);
  if (!value) return otherwise;
  if (!value->is_number_unsigned() || value->get<std::uint64_t>() < low || value->get<std::uint64_t>() > high)
    wrong(path_of(name), "a whole number from " + std::to_string(low) + " to " + std::to_string(high), *value);
  return value->get<std::uint64_t>();
}

const ordered_json* Fields::object(const char* name) {
  const ordered_json* value = find(name, false);
  if (value && !value->is_object()) wrong(path_of(name), "an object", *value);
  return value;
}

void Fields::end() const {
  for (const auto& [name, value] : object_.items())
    if (!known_.contains(name)) {
      std::string all;
      for (const std::string& each : known_) all += (all.empty() ? "" : ", ") + each;
      throw std::runtime_error(path_of(name) + ": no such field; there are " + all);
    }
}

const ordered_json* Fields::find(const char* name, bool needed) {
  known_.insert(name);
  const auto found = object_.find(name);
  if (found != object_.end()) return &*found;
  if (needed) throw std::runtime_error(path_of(name) + " is missing");
  return nullptr;
}

std::string Fields::path_of(const std::string& name) const {
  return where_ + (where_.ends_with(": ") ? "" : ".") + name;
}

void Fields::wrong(const std::string& where, const std::string& expected, const ordered_json& found) {
  const std::string what = where.ends_with(": ") ? where.substr(0, where.size() - 2) : where;
  throw std::runtime_error(what + " must be " + expected + " (found " + short_text(found) + ")");
}

}  // namespace command
