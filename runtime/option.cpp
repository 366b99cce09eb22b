#include "runtime/option.h"

#include <fmt/format.h>

#include <iterator>
#include <mutex>
#include <utility>

namespace vsplat {
namespace {

#define VSPLAT_OPTION(name) #name,
constexpr const char* kEnumerators[] = {VSPLAT_OPTIONS(VSPLAT_OPTION)};
#undef VSPLAT_OPTION
static_assert(std::size(kEnumerators) == kOptions, "kOptions counts up to the last enumerator");

struct Names {
  std::mutex mutex;
  OptionNames own;
};

// Never destroyed, since threads may write messages while the process ends.
Names& names() {
  static Names* const made = new Names;
  return *made;
}

}  // namespace

std::string option_name(Option option) {
  const auto at = static_cast<std::size_t>(option);
  Names& all = names();
  const std::lock_guard lock(all.mutex);
  return all.own[at].empty() ? kEnumerators[at] : all.own[at];
}

void set_option_names(OptionNames given) {
  Names& all = names();
  const std::lock_guard lock(all.mutex);
  all.own = std::move(given);
}

}  // namespace vsplat

fmt::format_context::iterator fmt::formatter<vsplat::Option>::format(vsplat::Option option,
                                                                     fmt::format_context& ctx) const {
  return fmt::formatter<fmt::string_view>::format(vsplat::option_name(option), ctx);
}
