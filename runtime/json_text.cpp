#include "runtime/json_text.h"

#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "runtime/fail.h"
#include "runtime/printable.h"

namespace vsplat {

using nlohmann::json;

namespace {

// Builds the value while it checks the text. (The library's own builder with a callback visits all members of an object
// after each member that is an object: this takes minutes for some ten thousand members.)
class Builder : public nlohmann::json_sax<json> {
 public:
  Builder(const std::string& what, int deepest) : what_(what), deepest_(static_cast<std::size_t>(deepest)) {}

  json take() { return std::move(root_); }

  bool null() override { return value(nullptr); }
  bool boolean(bool v) override { return value(v); }
  bool number_integer(number_integer_t v) override { return value(v); }
  bool number_unsigned(number_unsigned_t v) override { return value(v); }
  bool number_float(number_float_t v, const string_t&) override { return value(v); }
  bool string(string_t& v) override { return value(std::move(v)); }
  bool binary(binary_t& v) override { return value(std::move(v)); }
  bool start_object(std::size_t) override { return open(json::object()); }
  bool start_array(std::size_t) override { return open(json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }
  bool key(string_t& name) override {
    const auto [at, is_new] = open_.back()->emplace(name, nullptr);
    if (!is_new) fail(Status::format, "{}: an object has the field {} twice", what_, printable(name));
    member_ = &*at;
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
  json* put(json v) {
    if (open_.size() > deepest_) fail(Status::format, "{}: nested deeper than {} levels", what_, deepest_);
    json* const into = open_.empty() ? &root_ : open_.back()->is_array() ? &open_.back()->emplace_back() : member_;
    *into = std::move(v);
    return into;
  }
  bool value(json v) {
    put(std::move(v));
    return true;
  }
  bool open(json v) {
    open_.push_back(put(std::move(v)));
    return true;
  }
  bool close() {
    open_.pop_back();
    return true;
  }

  const std::string& what_;
  std::size_t deepest_;
  json root_;
  std::vector<json*> open_;  // objects and arrays that have not ended
  json* member_ = nullptr;   // of the innermost object, for the value that follows its name
};

}  // namespace

nlohmann::json parse_json(const std::string& what, const std::string& text, int deepest) {
  Builder builder(what, deepest);
  json::sax_parse(text, &builder);
  return builder.take();
}

}  // namespace vsplat
