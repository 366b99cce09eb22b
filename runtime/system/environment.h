// Returns an environment variable; empty if it is not set.
#pragma once
#include <cstdlib>
#include <string>

namespace vsplat {

inline std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value ? value : "";
}

}  // namespace vsplat
