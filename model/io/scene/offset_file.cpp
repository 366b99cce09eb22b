#include "model/io/scene/offset_file.h"

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>

#include "runtime/files/output_file.h"

namespace vsplat {
namespace {

namespace fs = std::filesystem;

// Whether `file` was written for a scene of this name, and not by somebody else for another purpose.
bool belongs_to(const fs::path& file, const std::string& scene) {
  std::error_code error;
  if (!fs::is_regular_file(file, error) || fs::file_size(file, error) > 4096 || error) return false;
  std::ifstream in(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  const auto found = nlohmann::json::parse(text, nullptr, false);
  return found.is_object() && found.contains("offset") && found.value("scene", nlohmann::json()) == scene;
}

}  // namespace

fs::path offset_file_of(const fs::path& scene) { return fs::path(scene).replace_extension(".offset.json"); }

void write_offset_file(const fs::path& path, const Scene& scene) {
  const fs::path file = offset_file_of(path);
  const std::string name = path.filename().string();
  if (scene.offset.isZero(0)) {
    if (std::error_code error; belongs_to(file, name)) fs::remove(file, error);
    return;
  }
  const nlohmann::ordered_json text = {{"scene", name},
                                       {"offset", {scene.offset[0], scene.offset[1], scene.offset[2]}}};
  OutputFile out(file.string());
  out.write(text.dump(1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n");
  out.commit();
}

}  // namespace vsplat
