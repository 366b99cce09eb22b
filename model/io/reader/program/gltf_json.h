// The JSON of a glTF file, with each value's place in it for errors: "meshes[0].primitives[1].indices".
#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace vsplat::read {

// What is there, or that nothing is: null is nothing. A value of another type than is asked for is a Wrong(format).
class Field {
 public:
  Field(const nlohmann::json* value, std::string place) : value_(value), place_(std::move(place)) {}

  bool there() const { return value_ != nullptr && !value_->is_null(); }
  const std::string& place() const { return place_; }

  Field operator[](const char* name) const;  // of an object
  Field operator[](std::size_t i) const;     // of an array
  std::size_t size() const;                  // of an array; of nothing, 0
  std::vector<std::string> names() const;    // of an object's values

  double number(double otherwise) const;
  std::uint64_t whole() const;  // at least 0; nothing is an error
  std::uint64_t whole(std::uint64_t otherwise) const { return there() ? whole() : otherwise; }
  std::string text(const std::string& otherwise = "") const;
  bool flag(bool otherwise) const;
  std::vector<double> numbers(std::size_t count) const;  // finite; of nothing, none

  // The element of `list` whose number this is.
  Field in(const Field& list) const;
  std::size_t index(std::size_t count, const char* of) const;

  [[noreturn]] void wrong(const std::string& text) const;

 private:
  [[noreturn]] void is_not(const char* expected) const;

  const nlohmann::json* value_;
  std::string place_;
};

}  // namespace vsplat::read
