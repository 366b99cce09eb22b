#include "runtime/library_programs.h"

#include <dlfcn.h>

#include <filesystem>

namespace vsplat {

namespace fs = std::filesystem;

std::string library_program(const std::string& name) {
  Dl_info library{};
  if (::dladdr(reinterpret_cast<const void*>(&library_program), &library) == 0 || !library.dli_fname) return "";
  std::error_code problem;
  fs::path real = fs::canonical(library.dli_fname, problem);
  if (problem) real = library.dli_fname;
  // A library that lies where none is installed is one of a build, or was packed together with what it needs.
  const fs::path folder = real.parent_path();
  const bool installed = folder.string().ends_with(VSPLAT_LIBRARY_FOLDER);
  return (folder / (installed ? VSPLAT_PROGRAMS_FROM_LIBRARY : "../libexec/vsplat") / name).lexically_normal().string();
}

}  // namespace vsplat
