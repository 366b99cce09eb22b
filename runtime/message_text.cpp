#include "runtime/message_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <type_traits>
#include <vector>

namespace vsplat {
namespace {

struct NotFiniteNumber {
  double value;
};

// fmt prints "-nan" for half of all NaN.
const char* word_for_number(double value) { return std::isnan(value) ? "NaN" : value > 0 ? "infinity" : "-infinity"; }

}  // namespace
}  // namespace vsplat

// Takes the format of any number ("{:.2f}"), which does not apply to a name.
template <>
struct fmt::formatter<vsplat::NotFiniteNumber> {
  constexpr auto parse(fmt::format_parse_context& ctx) { return std::find(ctx.begin(), ctx.end(), '}'); }
  template <class Context>
  auto format(const vsplat::NotFiniteNumber& number, Context& ctx) const {
    return fmt::format_to(ctx.out(), "{}", vsplat::word_for_number(number.value));
  }
};

namespace vsplat {

std::string message_text(fmt::string_view text, fmt::format_args args) {
  using Argument = fmt::basic_format_arg<fmt::format_context>;
  std::vector<Argument> all;
  std::deque<NotFiniteNumber> named;  // the arguments hold pointers to these
  for (int i = 0; const Argument argument = args.get(i); ++i) {
    all.push_back(argument);
    const auto name = [&](const auto& value) {
      if constexpr (std::is_floating_point_v<std::decay_t<decltype(value)>>)
        if (!std::isfinite(value)) {
          const auto store = fmt::make_format_args(named.emplace_back(NotFiniteNumber{static_cast<double>(value)}));
          all.back() = fmt::format_args(store).get(0);
        }
    };
#if FMT_VERSION >= 110000
    argument.visit(name);
#else
    fmt::visit_format_arg(name, argument);
#endif
  }
  if (named.empty()) return fmt::vformat(text, args);
  return fmt::vformat(text, fmt::format_args(all.data(), static_cast<int>(all.size())));
}

std::string number_text(double value) {
  return std::isfinite(value) ? fmt::format("{}", value) : word_for_number(value);
}
std::string number_text(float value) {
  return std::isfinite(value) ? fmt::format("{}", value) : word_for_number(value);
}

}  // namespace vsplat
