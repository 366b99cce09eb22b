#include "runtime/json_text.h"

#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {

using nlohmann::json;

nlohmann::json parse_json(const std::string& what, const std::string& text, int deepest) {
  std::vector<std::set<std::string>> fields;
  const json::parser_callback_t guard = [&](int depth, json::parse_event_t event, json& parsed) {
    if (depth > deepest) fail(Status::format, "{}: nested deeper than {} levels", what, deepest);
    if (event == json::parse_event_t::object_start) fields.emplace_back();
    if (event == json::parse_event_t::object_end) fields.pop_back();
    if (event == json::parse_event_t::key && !fields.back().insert(parsed.get_ref<const std::string&>()).second)
      fail(Status::format, "{}: an object has the field {} twice", what,
           printable(parsed.get_ref<const std::string&>()));
    return true;
  };
  try {
    return json::parse(text, guard);
  } catch (const json::exception& e) {
    std::string why = e.what();  // "[json.exception.parse_error.101] parse error at line 1, column 2: ..."
    why.erase(0, why.find("] ") == std::string::npos ? 0 : why.find("] ") + 2);
    for (char& c : why)  // it quotes the place, in a file that may be no text at all
      if (static_cast<unsigned char>(c) >= 0x7f) c = '?';
    fail(Status::format, "{}: is not valid JSON: {}", what, printable(why));
  }
}

}  // namespace vsplat
