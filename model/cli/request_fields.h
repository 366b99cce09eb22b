// Requests in JSON files: read strictly, with errors that name file and field.
#pragma once
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace command {

// The value in a file. Throws std::runtime_error that begins with the path if the file cannot be read, is larger than a
// MiB, or is no JSON; `what` says what was expected.
nlohmann::ordered_json parsed_file(const std::string& path, const std::string& what);

// For messages: the beginning of its JSON.
std::string short_text(const nlohmann::ordered_json& value);

// Fields of a JSON object in a file. Paths are relative to the file's folder.
class Fields {
 public:
  // `where` begins errors. Throws std::runtime_error, as the others do, if it is no object.
  Fields(const nlohmann::ordered_json& object, std::string where, std::filesystem::path folder);

  std::string text(const char* name, const std::optional<std::string>& otherwise = {});
  // `first` if the field is missing.
  std::string one_of_two(const char* name, const char* first, const char* second);
  std::string path(const char* name);  // "" if the field is missing
  std::vector<std::string> paths(const char* name);
  double number(const char* name, double low, double high, double otherwise);
  std::uint64_t count(const char* name, std::uint64_t low, std::uint64_t high, std::uint64_t otherwise);
  // Null if it is missing.
  const nlohmann::ordered_json* object(const char* name);
  const nlohmann::ordered_json* any(const char* name) { return find(name, false); }
  template <class Each>
  void objects(const char* name, bool needed, const Each& each) {
    if (const nlohmann::ordered_json* list = find(name, needed)) objects_of(*list, path_of(name), folder_, each);
  }
  // The same for a file that is a list.
  template <class Each>
  static void objects_of(const nlohmann::ordered_json& list, const std::string& where,
                         const std::filesystem::path& folder, const Each& each) {
    if (!list.is_array() || list.empty()) wrong(where, "a list of objects", list);
    for (std::size_t i = 0; i < list.size(); ++i) {
      Fields fields(list[i], where + "[" + std::to_string(i) + "]", folder);
      each(fields);
      fields.end();
    }
  }
  // The field as errors name it.
  std::string path_of(const std::string& name) const;
  // Fails if any other field is present.
  void end() const;
  [[noreturn]] static void wrong(const std::string& where, const std::string& expected,
                                 const nlohmann::ordered_json& found);

 private:
  const nlohmann::ordered_json* find(const char* name, bool needed);

  const nlohmann::ordered_json& object_;
  std::string where_;
  std::filesystem::path folder_;
  std::set<std::string> known_;
};

}  // namespace command
