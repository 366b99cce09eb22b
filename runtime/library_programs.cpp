#include "runtime/library_programs.h"

#include <filesystem>

#include "runtime/system/system.h"

namespace vsplat {

namespace fs = std::filesystem;

std::string library_program(const std::string& name, const void* inside) {
  const std::string library = sys::library_of(inside ? inside : reinterpret_cast<const void*>(&library_program));
  if (library.empty()) return "";
  std::error_code problem;
  fs::path real = fs::canonical(library, problem);
  if (problem) real = library;
  const fs::path folder = real.parent_path();
  if (folder.string().ends_with("libexec/vsplat"))
    return (folder / name).string();  // one of the programs, which has it
  // A library outside of an install folder is in a build folder, or was packed together with its programs.
  const bool installed = folder.string().ends_with(VSPLAT_LIBRARY_FOLDER);
  return (folder / (installed ? VSPLAT_PROGRAMS_FROM_LIBRARY : "../libexec/vsplat") / name).lexically_normal().string();
}

}  // namespace vsplat
