#include "model/io/views/unicode_form.h"

#include <utf8proc.h>

#include <algorithm>
#include <cstdlib>
#include <memory>

#include "model/io/any_case.h"

namespace vsplat {
namespace {

// `otherwise` if the text is not valid UTF-8.
std::string mapped(std::string_view text, int options, std::string otherwise) {
  utf8proc_uint8_t* bytes = nullptr;
  const utf8proc_ssize_t size =
      utf8proc_map(reinterpret_cast<const utf8proc_uint8_t*>(text.data()), static_cast<utf8proc_ssize_t>(text.size()),
                   &bytes, static_cast<utf8proc_option_t>(options | UTF8PROC_STABLE | UTF8PROC_COMPOSE));
  const std::unique_ptr<utf8proc_uint8_t, void (*)(void*)> owner(bytes, std::free);
  if (size < 0) return otherwise;
  return {reinterpret_cast<const char*>(bytes), static_cast<std::size_t>(size)};
}

}  // namespace

bool is_ascii(std::string_view text) {
  return std::all_of(text.begin(), text.end(), [](unsigned char c) { return c < 0x80; });
}

std::string composed(std::string_view text) {
  return is_ascii(text) ? std::string(text) : mapped(text, 0, std::string(text));
}

std::string folded(std::string_view text) {
  const std::string ascii = lower_case(std::string(text));
  return is_ascii(text) ? ascii : mapped(text, UTF8PROC_CASEFOLD, ascii);
}

}  // namespace vsplat
