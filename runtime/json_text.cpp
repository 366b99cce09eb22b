#include "runtime/json_text.h"

#include <nlohmann/json.hpp>
#include <set>
#include <vector>

#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {

using nlohmann::json;

namespace {

// Parses the text without building values. (A callback while the library builds them visits all members of an object
// after each member that is an object: this takes minutes for some ten thousand members.)
class Guard : public nlohmann::json_sax<json> {
 public:
  Guard(const std::string& what, int deepest) : what_(what), deepest_(static_cast<std::size_t>(deepest)) {}

  bool null() override { return value(); }
  bool boolean(bool) override { return value(); }
  bool number_integer(number_integer_t) override { return value(); }
  bool number_unsigned(number_unsigned_t) override { return value(); }
  bool number_float(number_float_t, const string_t&) override { return value(); }
  bool string(string_t&) override { return value(); }
  bool binary(binary_t&) override { return value(); }
  bool start_object(std::size_t) override { return open(); }
  bool start_array(std::size_t) override { return open(); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }
  bool key(string_t& name) override {
    if (!fields_.back().insert(name).second)
      fail(Status::format, "{}: an object has the field {} twice", what_, printable(name));
    return true;
  }
  bool parse_error(std::size_t byte, const std::string& found, const json::exception& e) override {
    constexpr int overflow = 406;  // nlohmann's number for it
    if (e.id == overflow)
      fail(Status::format, "{}: byte {}: the number {} is too large, at most 1.8e308 is read", what_,
           byte - found.size(), printable(found));
    std::string why = e.what();  // "[json.exception.parse_error.101] parse error at line 1, column 2: ..."
    why.erase(0, why.find("] ") == std::string::npos ? 0 : why.find("] ") + 2);
    for (char& c : why)  // the message quotes the text, which may be binary
      if (static_cast<unsigned char>(c) >= 0x7f) c = '?';
    fail(Status::format, "{}: is not valid JSON: {}", what_, printable(why));
  }

 private:
  bool value() const {
    if (fields_.size() > deepest_) fail(Status::format, "{}: nested deeper than {} levels", what_, deepest_);
    return true;
  }
  bool open() {
    value();
    fields_.emplace_back();
    return true;
  }
  bool close() {
    fields_.pop_back();
    return true;
  }

  const std::string& what_;
  std::size_t deepest_;
  std::vector<std::set<std::string>> fields_;  // fields of each open object
};

}  // namespace

nlohmann::json parse_json(const std::string& what, const std::string& text, int deepest) {
  Guard guard(what, deepest);
  json::sax_parse(text, &guard);
  return json::parse(text);
}

}  // namespace vsplat
