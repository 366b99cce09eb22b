#include "model/io/reader/program/gltf_json.h"

#include <fmt/format.h>

#include <cmath>

#include "model/io/reader/program/library.h"
#include "runtime/printable.h"

namespace vsplat::read {
namespace {

constexpr double most_whole = 9007199254740992;  // 2^53: the largest integer that a double counts to

}  // namespace

void Field::wrong(const std::string& text) const { fail_reading(Status::format, place_, text); }

void Field::is_not(const char* expected) const {
  if (!there()) wrong(fmt::format("is not there; {} is expected", expected));
  std::string found = value_->dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).substr(0, 60);
  wrong(fmt::format("is {}; {} is expected", printable(found), expected));
}

Field Field::operator[](const char* name) const {
  std::string place = place_.empty() ? name : fmt::format("{}.{}", place_, name);
  if (!there()) return {nullptr, std::move(place)};
  if (!value_->is_object()) is_not("an object");
  const auto found = value_->find(name);
  return {found == value_->end() ? nullptr : &*found, std::move(place)};
}

Field Field::operator[](std::size_t i) const {
  std::string place = fmt::format("{}[{}]", place_, i);
  if (i >= size()) return {nullptr, std::move(place)};
  return {&(*value_)[i], std::move(place)};
}

std::size_t Field::size() const {
  if (!there()) return 0;
  if (!value_->is_array()) is_not("an array");
  return value_->size();
}

std::vector<std::string> Field::names() const {
  std::vector<std::string> out;
  if (!there()) return out;
  if (!value_->is_object()) is_not("an object");
  for (auto it = value_->begin(); it != value_->end(); ++it) out.push_back(it.key());
  return out;
}

double Field::number(double otherwise) const {
  if (!there()) return otherwise;
  if (!value_->is_number()) is_not("a number");
  const auto out = value_->get<double>();
  if (!std::isfinite(out)) is_not("a finite number");
  return out;
}

std::uint64_t Field::whole() const {
  const double out = there() && value_->is_number() ? value_->get<double>() : -1;
  if (!(out >= 0) || out > most_whole || out != std::floor(out)) is_not("a whole number of at least 0");
  return static_cast<std::uint64_t>(out);
}

std::string Field::text(const std::string& otherwise) const {
  if (!there()) return otherwise;
  if (!value_->is_string()) is_not("a text");
  return value_->get<std::string>();
}

bool Field::flag(bool otherwise) const {
  if (!there()) return otherwise;
  if (!value_->is_boolean()) is_not("true or false");
  return value_->get<bool>();
}

std::vector<double> Field::numbers(std::size_t count) const {
  std::vector<double> out;
  if (!there()) return out;
  if (size() != count) wrong(fmt::format("has {} numbers, {} are expected", size(), count));
  for (std::size_t i = 0; i < count; ++i) out.push_back((*this)[i].number(0));
  return out;
}

std::size_t Field::index(std::size_t count, const char* of) const {
  const std::uint64_t out = whole();
  if (out >= count) wrong(fmt::format("is {}; there are {} {}", out, count, of));
  return static_cast<std::size_t>(out);
}

Field Field::in(const Field& list) const { return list[index(list.size(), list.place().c_str())]; }

}  // namespace vsplat::read
