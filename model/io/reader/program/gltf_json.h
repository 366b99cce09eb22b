// The JSON of a glTF file, with each value's path for errors: "meshes[0].primitives[1].indices".
#pragma once
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace vsplat::read {

// A value or its absence; null counts as absent. Requesting another type than the value has throws Wrong(format).
class Field {
 public:
  Field(const nlohmann::json* value, std::string place) : value_(value), place_(std::move(place)) {}

  bool there() const { return value_ != nullptr && !value_->is_null(); }
  const std::string& place() const { return place_; }

  Field operator[](const char* name) const;  // of an object
  Field operator[](std::size_t i) const;     // of an array
  std::size_t size() const;                  // of an array; 0 if absent
  std::vector<std::string> names() const;    // keys of an object

  double number(double otherwise) const;
  std::uint64_t whole() const;  // at least 0; an absent value is an error
  std::uint64_t whole(std::uint64_t otherwise) const { return there() ? whole() : otherwise; }
  std::string text(const std::string& otherwise = "") const;
  bool flag(bool otherwise) const;
  std::vector<double> numbers(std::size_t count) const;  // finite; empty if absent

  // The element of `list` that this value is the index of.
  Field in(const Field& list) const;
  std::size_t index(std::size_t count, const char* of) const;

  [[noreturn]] void wrong(const std::string& text) const;

 private:
  [[noreturn]] void is_not(const char* expected) const;

  const nlohmann::json* value_;
  std::string place_;
};

}  // namespace vsplat::read
