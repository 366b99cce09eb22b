// Puts the path of a file before an error about its contents: the library has only a handle, read earlier, without a
// name.
#pragma once
#include <string>
#include <vector>
#include <vsplat/vsplat.hpp>

namespace command {

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
      named = named || text.find(paths[i]) != std::string::npos;
    }
    if (paths.size() > shown) all += " and " + std::to_string(paths.size() - shown) + " more";
    for (const std::string& path : others) named = named || (!path.empty() && text.find(path) != std::string::npos);
    if (named || all.empty()) throw;
    throw vsplat::Error(status, (all + ": " + text).c_str());
  }
}

}  // namespace command
