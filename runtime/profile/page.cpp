#include "runtime/profile/page.h"

#include "runtime/fail.h"

namespace vsplat {
namespace {

std::string in_element(const std::string& text) {
  std::string out;
  out.reserve(text.size());
  for (const char c : text) {
    if (c == '<')
      out += "\\u003c";
    else if (c == '>')
      out += "\\u003e";
    else if (c == '&')
      out += "\\u0026";
    else
      out += c;
  }
  return out;
}

}  // namespace

std::string page_with(const EmbeddedFile& page, const std::string& json) {
  std::string out = page.text;
  const std::string mark = "@DATA@";
  const std::size_t at = out.find(mark);
  if (at == std::string::npos) fail(Status::internal, "{} has no place for its data", page.name);
  return out.replace(at, mark.size(), in_element(json));
}

}  // namespace vsplat
