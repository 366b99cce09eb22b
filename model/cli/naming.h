// Puts the path of a file before an error about its contents: the library has only a handle, read earlier, without a
// name.
#pragma once
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

namespace command {

// Whether `text` has `path` as a word, or as the start of a longer path: a folder "a" is not named by any "a".
inline bool names(const std::string& text, const std::string& path) {
  for (std::size_t at = 0; !path.empty() && (at = text.find(path, at)) != std::string::npos; ++at) {
    const std::size_t end = at + path.size();
    const bool begins = at == 0 || text[at - 1] == ' ' || text[at - 1] == '(' || text[at - 1] == '"';
    if (begins && (path.back() == '/' || end == text.size() || text[end] == ':' || text[end] == '/')) return true;
  }
  return false;
}

// Returns run(). An error about the contents of a file begins with `paths`, unless it names one of them or of `others`.
template <class F>
auto naming(const std::vector<std::string>& paths, const std::vector<std::string>& others, const F& run) {
  constexpr std::size_t shown = 3;
  try {
    return run();
  } catch (const vsplat::Error& e) {
    const std::string text = e.what();
    const vsplat_status status = e.status();
    bool named = status != VSPLAT_ERROR_FILE && status != VSPLAT_ERROR_FORMAT && status != VSPLAT_ERROR_INPUT;
    std::string all;
    for (std::size_t i = 0; i < paths.size(); ++i) {
      if (i < shown) all += (all.empty() ? "" : ", ") + paths[i];
      named = named || names(text, paths[i]);
    }
    if (paths.size() > shown) all += " and " + std::to_string(paths.size() - shown) + " more";
    for (const std::string& path : others) named = named || names(text, path);
    if (named || all.empty()) throw;
    throw vsplat::Error(status, (all + ": " + text).c_str());
  }
}

}  // namespace command
